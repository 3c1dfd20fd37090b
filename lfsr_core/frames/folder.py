"""The frame folder: what it holds, whether that is what was asked for, and how new files come into it."""

from __future__ import annotations

import contextlib
import re
import shutil
from collections.abc import Collection
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import check_name, reading, replace_files
from lfsr_core.frames import frame as files
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.frame import Frame, read_frame, read_part, read_rendered
from lfsr_core.frames.identity import check_same, is_of, is_same
from lfsr_core.frames.report import Report, read_report
from lfsr_core.frames.request import Request

RENDERED_FILES = {"render": (files.LOW_RES_FILE,), "reference": files.REFERENCE_FILES}
# Made from an older render of the same folder, so they would no longer match it.
DERIVED_FILES = (files.EIA_FILE, files.EIA_LINEAR_FILE, files.PANEL_FILE, files.MASK_FILE, files.REPORT_FILE,
                 files.VIEWER_FILE, files.WORLD_FILE, files.LOG_FILE)
ROOM = 70  # letters that the longest path in a staging folder has more than its target
PNG_END = b"IEND\xaeB`\x82"
NUMBERED = re.compile(r"-?\d{3,}$")  # names of the folders of an animation's frames


class FrameFolder:
    """A folder that holds a render, a reference or nothing yet, and what was made of it."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    @classmethod
    def of_frame(cls, output: str | Path, number: int) -> FrameFolder:
        """Return the folder of frame ``number`` of an animation in ``output``, such as ``0001``."""
        return cls(Path(output) / f"{number:04d}")

    @property
    def frame(self) -> Frame:
        """The rendered light field; LfsrError where there is none, or a part of one, or the panel's subpixels."""
        return read_frame(self.path)

    @property
    def rendered(self) -> Frame:
        """The rendered light field or panel image; LfsrError where there is none, or a part of one."""
        return read_rendered(self.path)

    @property
    def part(self) -> Frame:
        """The rendered frame, or the part of one; LfsrError where there is none."""
        return read_part(self.path)

    @property
    def readable(self) -> Frame | None:
        """As ``part``, None where it cannot be read."""
        with contextlib.suppress(LfsrError):
            return self.part
        return None

    @property
    def report(self) -> Report:
        """How it was finished; LfsrError where it was not."""
        return read_report(self.path)

    @property
    def image(self) -> Path:
        """File of the finished image, whether it is there or not."""
        found = self.readable
        return self.path / (files.PANEL_FILE if found and found.layout == files.SUBPIXELS else files.EIA_FILE)

    @property
    def parts(self) -> Path:
        """Hidden folder for the finished parts of a long render into this one."""
        path = self.path.absolute()  # "." has no name
        return path.with_name(f".{path.name}-parts")

    def holds(self, kind: str = "render") -> bool:
        """True if it has all files of a render, or of a reference where that is the ``kind``."""
        return all((self.path / name).is_file() for name in (files.FRAME_FILE, *RENDERED_FILES[kind]))

    def is_of(self, source: str, scene_name: str = "") -> bool:
        """False if it is known to be a render of another file than ``source``, or of another scene in it."""
        found = self.readable
        return found is None or is_of(found, source, scene_name)

    def is_rendered(self, request: Request) -> bool:
        """True if it holds the whole render of ``request``, on any device; its files are read to their ends."""
        found = self.readable
        return (found is not None and is_same(found, request)
                and all(is_whole(self.path / name) for name in RENDERED_FILES[request.kind]))

    def check_rendered(self, request: Request, content: str = "", names: Collection[str] | None = None,
                       advice: str = "choose another folder") -> None:
        """LfsrError with the first difference unless it holds the render of ``request``, or a part of it.

        ``content``: of the scene's file, as of ``Frame.content``, empty for any; ``names``: facts to compare, None for
        all; ``advice``: what the user can do.
        """
        check_same(self.path, request, content, names, advice)

    def is_finished(self, finish: Finish, beside: Collection[int] = ()) -> bool:
        """True if its image is whole and was finished so, averaged with the frames ``beside`` it."""
        try:
            report = self.report
        except LfsrError:
            return False
        if report.finish != finish or not set(beside) <= set(report.neighbours):
            return False
        if finish.linear_exr and not is_whole(self.path / files.EIA_LINEAR_FILE):
            return False
        return _ends_as_png(self.image)

    def check_free(self, kind: str) -> None:
        """LfsrError if it is a file or holds another kind of render, which must not be lost."""
        check_name(self.path.absolute(), ROOM)
        if self.path.exists() and not self.path.is_dir():
            raise LfsrError(f"{self.path} is a file, but the output must be a folder: choose another name")
        for other, names in RENDERED_FILES.items():
            if other != kind and any((self.path / name).exists() for name in names):
                raise LfsrError(f"{self.path} already holds a {other}, but a {kind} was asked for: choose another "
                                "folder")

    def publish(self, staged: Path) -> None:
        """Take the render in the folder ``staged``: all that was made of an older one goes, and its stored parts."""
        self.path.mkdir(exist_ok=True)
        replace_files(staged, self.path, DERIVED_FILES)
        shutil.rmtree(self.parts, ignore_errors=True)


def numbered(output: Path) -> dict[int, FrameFolder]:
    """Rendered frames of an animation in ``output``, by their numbers."""
    found = output.iterdir() if output.is_dir() else ()
    return {int(path.name): FrameFolder(path) for path in found
            if NUMBERED.match(path.name) and FrameFolder(path).holds()}


def is_whole(path: Path) -> bool:
    """True if an EXR file can be read to its end."""
    from lfsr_core.images.exr import check_complete  # needs OpenImageIO, which Blender's panel does without

    with contextlib.suppress(LfsrError):
        check_complete(path)
        return True
    return False


def _ends_as_png(path: Path) -> bool:
    with contextlib.suppress(OSError, LfsrError), reading(path, "a PNG image") as file:
        file.seek(-min(len(PNG_END), path.stat().st_size), 2)
        return file.read() == PNG_END
    return False
