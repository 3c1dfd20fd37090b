"""How near denoisers come to references, on known and unprepared scenes."""
