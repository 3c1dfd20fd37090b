"""The finished frame folders of an animation, in order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import EIA_FILE, FRAME_FILE, Frame
from lfsr_core.optics.display import DisplayProfile


def is_sequence(folder: str | Path) -> bool:
    """Whether ``folder`` exists and is no frame folder itself."""
    return Path(folder).is_dir() and not (Path(folder) / FRAME_FILE).is_file()


def frame_folders(folder: str | Path, images: Sequence[str] = (EIA_FILE,)) -> list[Path]:
    """``folder`` itself if it is a frame folder, else the finished frame folders in it; LfsrError where there is none.

    Numbered folders come first, by number. ``images``: a frame is finished if it holds one of these files.
    """
    folder = Path(folder)
    if not is_sequence(folder):
        return [folder]
    found = [path.parent for path in folder.glob(f"*/{FRAME_FILE}")
             if any((path.parent / name).is_file() for name in images)]
    if not found:
        raise LfsrError(f"{folder} is no frame folder and holds none with an {' or '.join(images)}: give one that "
                        "`lfsr render` made")
    return sorted(found, key=_place)


def one_display(frames: Mapping[Path, Frame]) -> DisplayProfile:
    """Display of ``frames``, given by folder; LfsrError where they have several displays."""
    (first, frame), *others = frames.items()
    for folder, other in others:
        if other.display != frame.display:
            raise LfsrError(f"{folder} is for display {other.display.name!r} and {first} for {frame.display.name!r}, "
                            "but they are shown together: give frames of one display")
    return frame.display


def _place(folder: Path) -> tuple[bool, int, str]:
    """Sorting key: numbers by value, then other names."""
    try:
        return False, int(folder.name), ""
    except ValueError:
        return True, 0, folder.name
