"""Displays as the panel lists them."""

from __future__ import annotations

import zlib

from lfsr_core.optics.display import DisplayProfile, builtin_names, load_display

PROFILE_FILE = "FILE"
FIRST_PROFILES = ("bupt-32in-8k", "dense-8k", "fhd", "mini", "small")
TITLES = {
    "bupt-32in-8k": "32″ 8K (BUPT)", "dense-8k": "32″ 8K, More Lenses", "fhd": "32″ Full HD",
    "looking-glass-go": "Looking Glass Go", "looking-glass-portrait": "Looking Glass Portrait",
    "looking-glass-8.9": "Looking Glass 8.9″ Gen 1", "looking-glass-15.6": "Looking Glass 15.6″ Gen 1",
    "looking-glass-16": "Looking Glass 16″ Gen 2", "looking-glass-16-gen3": "Looking Glass 16″ Gen 3",
    "looking-glass-32": "Looking Glass 32″ Gen 2", "looking-glass-65": "Looking Glass 65″",
    "cubevi-c1": "CubeVi C1", "litiholo": "LitiHolo Hologram Printer",
    "small": "14″ for Trials", "mini": "5″ for Trials"}


def title_of(display: DisplayProfile) -> str:
    """Return what the panel calls a display: a built-in one by its title, another by its own name."""
    return TITLES.get(display.name, display.name)


def profile_items() -> list[tuple[str, str, str, str, int]]:
    """Enum items of the built-in displays and of a profile in a file."""
    names = builtin_names()
    items = []
    for name in sorted(names, key=list(TITLES).index):
        # A saved scene keeps the number: those of the first profiles are their places.
        number = FIRST_PROFILES.index(name) + 1 if name in FIRST_PROFILES else zlib.crc32(name.encode()) & 0x7FFFFFFF
        items.append((name, TITLES[name], load_display(name).description.rstrip("."), "DESKTOP", number))
    return [*items, (PROFILE_FILE, "From File…", "Display profile in a .toml file", "FILE", 0)]
