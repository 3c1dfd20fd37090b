"""Records: frozen dataclasses and the JSON they are kept in."""
