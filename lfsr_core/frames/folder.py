"""The frame folder: what it holds, whether that is what was asked for, and how new files come into it.

Its identity is what decides the pixels of a render, and which version of a scene they show.
"""

import contextlib
import dataclasses
import hashlib
import json
import re
import shutil
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import to_data
from lfsr_core.base.system import check_name, file_stamp, place_beside, reading, replace_files, system_errors
from lfsr_core.frames import frame as files
from lfsr_core.frames.frame import AUTO, LAYOUTS, SUBPIXELS, TIMES_RAYS, Finish, Frame, Report, Request
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import rows_text

RENDERED_FILES = {"render": (files.LOW_RES_FILE,), "reference": files.REFERENCE_FILES}
# Made from an older render of the same folder, so they would no longer match it.
DERIVED_FILES = (files.EIA_FILE, files.EIA_LINEAR_FILE, files.PANEL_FILE, files.MASK_FILE, files.REPORT_FILE,
                 files.VIEWER_FILE, files.WORLD_FILE, files.LOG_FILE)
ROOM = 70  # letters that the longest path in a staging folder has more than its target
PNG_END = b"IEND\xaeB`\x82"
NUMBERED = re.compile(r"-?\d{3,}$")  # names of the folders of an animation's frames
Facts = Mapping[str, object]  # what decides pixels, by name
PLACES = ("output", "parts", "world", "source", "allow_missing", "first_view", "calm")  # no pixel depends on them
PLURAL = ("samples", "lens_list", "rows", "layers")
SAMPLES = " samples per pixel"
FARM_COPY = ".farm"  # ends the name of the copy of a file that a farm renders
LABELS = {"world_visible": "visible world", "world_apart": "world image", "matrix_world": "camera placement",
          "frame": "frame number"}
DIGEST_SIZE, MOST_SHOWN = 12, 60  # bytes, characters
COMPANIONS = (".bin", ".mtl")  # of a scene, beside .gltf and .obj
BETWEEN = "; "  # stamps of files


class FrameFolder:
    """A folder that holds a render, a reference or nothing yet, and what was made of it."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    @classmethod
    def of_frame(cls, output: str | Path, number: int) -> Self:
        """Return the folder of frame ``number`` of an animation in ``output``, such as ``0001``."""
        return cls(Path(output) / f"{number:04d}")

    @property
    def frame(self) -> Frame:
        """The rendered light field; LfsrError where there is none, or a part of one, or the panel's subpixels."""
        return files.read_frame(self.path)

    @property
    def rendered(self) -> Frame:
        """The rendered light field or panel image; LfsrError where there is none, or a part of one."""
        return files.read_rendered(self.path)

    @property
    def part(self) -> Frame:
        """The rendered frame, or the part of one; LfsrError where there is none."""
        return files.read_part(self.path)

    @property
    def readable(self) -> Frame | None:
        """As ``part``, None where it cannot be read."""
        with contextlib.suppress(LfsrError):
            return self.part
        return None

    @property
    def report(self) -> Report:
        """How it was finished; LfsrError where it was not."""
        return files.read_report(self.path)

    @property
    def image(self) -> Path:
        """File of the finished image, whether it is there or not."""
        frame = self.readable
        return self.path / (files.PANEL_FILE if frame and frame.layout == SUBPIXELS else files.EIA_FILE)

    @property
    def parts(self) -> Path:
        """Hidden folder for the finished parts of a long render into this one."""
        path = self.path.resolve()  # "." has no name
        return place_beside(path) / f".{path.name}-parts"

    def holds(self, kind: str = "render") -> bool:
        """True if it has all files of a render, or of a reference where that is the ``kind``."""
        return all((self.path / name).is_file() for name in (files.FRAME_FILE, *RENDERED_FILES[kind]))

    def is_rendered(self, request: Request) -> bool:
        """True if it holds the whole render of ``request``, on any device; its files are read to their ends."""
        frame = self.readable
        return (frame is not None and is_same(frame, request)
                and all(is_whole(self.path / name) for name in RENDERED_FILES[request.kind]))

    def check_rendered(self, request: Request, content: str = "", names: Collection[str] | None = None,
                       advice: str = "choose another folder") -> None:
        """LfsrError with the first difference unless it holds the render of ``request``, or a part of it.

        ``content``: of the scene's file, as of ``Frame.content``, empty for any; ``names``: facts to compare, None for
        all; ``advice``: what the user can do.
        """
        frame = self.part
        facts = wanted_facts(request, frame, content)
        wanted = {name: value for name, value in facts.items() if names is None or name in names}
        if name := first_difference(vars(frame), wanted):
            if name == "content":
                raise LfsrError(f"{self.path} was rendered before {frame.scene} was changed: {advice}")
            here, there = phrases(name, vars(frame)[name], wanted[name])
            verb = "were" if name in PLURAL else "was"
            raise LfsrError(f"{self.path} was rendered with {here}, but {there.removesuffix(SAMPLES)} {verb} asked "
                            f"for: {advice}")

    def is_finished(self, finish: Finish, beside: Collection[int] = ()) -> bool:
        """True if its image is whole and was made with ``finish``, averaged with the frames ``beside`` it."""
        image = self.image
        with contextlib.suppress(OSError, LfsrError):
            report = self.report
            if report.finish == finish and set(beside) <= set(report.neighbours) and (
                    not finish.linear_exr or is_whole(self.path / files.EIA_LINEAR_FILE)):
                with reading(image, "a PNG image") as file:
                    file.seek(-min(len(PNG_END), image.stat().st_size), 2)
                    return file.read() == PNG_END
        return False

    def check_free(self, kind: str) -> None:
        """LfsrError if it is a file, or holds another kind of render or files of no render, which must not be lost."""
        check_name(self.path.absolute(), ROOM)
        if self.path.exists() and not self.path.is_dir():
            raise LfsrError(f"{self.path} is a file, but the output must be a folder: choose another name")
        for other, names in RENDERED_FILES.items():
            if other != kind and any((self.path / name).exists() for name in names):
                raise LfsrError(f"{self.path} holds a {other}, but a {kind} was asked for: choose another folder")
        derived = [name for name in DERIVED_FILES if name != files.LOG_FILE and (self.path / name).exists()]
        # A folder whose publishing was killed lacks its frame.json, but not the render.
        if derived and not any((self.path / name).exists() for name in (files.FRAME_FILE, *RENDERED_FILES[kind])):
            raise LfsrError(f"{self.path} holds {derived[0]} but no render, which would replace it: choose another one")

    def publish(self, staged: Path) -> None:
        """Move the render in ``staged`` here, and remove what was made of an older one, and the stored parts."""
        self.path.mkdir(exist_ok=True)
        replace_files(staged, self.path, DERIVED_FILES)
        shutil.rmtree(self.parts, ignore_errors=True)


def numbered(output: Path) -> dict[int, FrameFolder]:
    """Rendered frames of an animation in ``output``, by their numbers."""
    return {int(path.name): FrameFolder(path) for path in (output.iterdir() if output.is_dir() else ())
            if NUMBERED.match(path.name) and FrameFolder(path).holds()}


def is_sequence(folder: str | Path) -> bool:
    """Whether ``folder`` exists and is no frame folder itself."""
    return Path(folder).is_dir() and not (Path(folder) / files.FRAME_FILE).is_file()


def frame_folders(folder: str | Path, images: Sequence[str] = (files.EIA_FILE,)) -> list[Path]:
    """``folder`` itself if it is a frame folder, else the finished frame folders in it; LfsrError where there is none.

    Numbered folders come first, by number. ``images``: a frame is finished if it holds one of these files.
    """
    folder = Path(folder)
    if not is_sequence(folder):
        return [folder]
    folders = [path.parent for path in folder.glob(f"*/{files.FRAME_FILE}")
               if any((path.parent / name).is_file() for name in images)]
    if not folders:
        raise LfsrError(f"{folder} is no frame folder and holds none with an {' or '.join(images)}: give one that "
                        "`lfsr render` made")
    numbers = {path: int(path.name) for path in folders if re.fullmatch(r"-?\d+", path.name)}
    return sorted(folders, key=lambda path: (path not in numbers, numbers.get(path, 0), path.name))


def one_display(frames: Mapping[Path, Frame]) -> DisplayProfile:
    """Display of ``frames``, given by folder; LfsrError where they have several displays."""
    (first, frame), *others = frames.items()
    for folder, other in others:
        if other.display != frame.display:
            raise LfsrError(f"{folder} is for display {other.display.name!r} and {first} for {frame.display.name!r}, "
                            "but they are shown together: give frames of one display")
    return frame.display


def is_whole(path: Path) -> bool:
    """True if an EXR file can be read to its end."""
    from lfsr_core.images.image_files import check_complete  # needs OpenImageIO, which Blender's panel does without

    with contextlib.suppress(LfsrError):
        check_complete(path)
        return True
    return False


def digest(data: object) -> str:
    """Return a short text that differs where JSON-ready ``data`` differs."""
    return hashlib.blake2b(json.dumps(data, sort_keys=True).encode(), digest_size=DIGEST_SIZE).hexdigest()


def scene_stamp(path: str | Path) -> str:
    """Return size and time of change of a scene's file and of those that belong to it; LfsrError if it is missing."""
    path = Path(path)
    with system_errors(path):
        path.stat()
        companions = () if path.suffix.lower() == ".blend" else sorted(
            other for other in path.parent.iterdir() if other.suffix.lower() in COMPANIONS)
    return BETWEEN.join(map(file_stamp, (path, *companions)))


def request_facts(request: Request, free: Collection[str] = PLACES) -> dict[str, Any]:
    """Return the fields of a request, JSON-ready, without those named in ``free``."""
    return {name: value for name, value in to_data(request).items() if name not in free}


def wanted_facts(request: Request, frame: Frame, content: str = "") -> Facts:
    """Return the fields that a frame must have to be the render of ``request``.

    Where the request leaves a value open, the frame's own is returned: the device, a scale to choose, or a multiple of
    the rays for a noisy scene. A reference may have other samples and lenses than its request. ``content``: stamp of
    the scene's file, empty for any.
    """
    is_reference, sampling = request.kind == "reference", request.sampling
    scale = frame.scale if frame.scale in sampling.scales else sampling.scale
    samples = request.samples_at(scale)
    if is_reference or (sampling.rays is not None and frame.samples in (samples * times for times in TIMES_RAYS)):
        samples = frame.samples
    is_open_layout = request.layout == LAYOUTS[0] and frame.layout != SUBPIXELS  # some devices need the lens card
    return {"display": request.display, "scale": scale, "samples": samples, "convention": request.convention,
            "layout": frame.layout if is_open_layout else request.layout, "view_aperture": request.view_aperture,
            "lens_list": frame.lens_list if is_reference else request.lens_list, "rows": request.rows,
            "frame": frame.frame if request.frame is None else request.frame, "subject": request.subject or "",
            "scene_name": request.scene_name if request.scene_name and frame.scene_name else frame.scene_name,
            "source": frame.source if is_of(frame, request.source) else request.source, "camera": request.camera or "",
            "device": frame.device if request.device == AUTO else request.device, "seed": request.seed,
            "light": frame.light if request.light == AUTO or not frame.light else request.light,
            "world_visible": frame.world_visible if request.world_visible is None else request.world_visible,
            "layers": frame.layers if set(request.layers) <= set(frame.layers) else request.layers,
            "content": content if is_changed(frame.content, content) else frame.content}


def is_of(frame: Frame | None, source: str, scene_name: str = "") -> bool:
    """True if ``frame`` may be a render of the file ``source``, as of ``Frame.source``, and of the scene in it.

    A frame that does not know its source, such as that of a farm, is known by its file's name; "" and None are any.
    """
    if frame is None:
        return True
    if scene_name and frame.scene_name not in ("", scene_name):
        return False
    if frame.source or not (source and frame.scene):
        return not source or frame.source in ("", source)
    return Path(frame.scene).stem.removesuffix(FARM_COPY) == Path(source).stem


def is_changed(before: str, now: str) -> bool:
    """True if two stamps of a scene differ, as far as both are known."""
    return bool(before and now) and before != now


def has_other_size(first: str, second: str) -> bool:
    """True if two stamps of a scene, on two machines perhaps, are of files of other sizes, as far as both are known."""
    sizes = [[stamp.split(" ")[0] for stamp in stamps.split(BETWEEN)] for stamps in (first, second)]
    return bool(first and second) and sizes[0] != sizes[1]


def first_difference(facts: Facts, wanted: Facts) -> str:
    """Return the name of the first of the ``wanted`` facts that is another in ``facts``, "" where there is none."""
    return next((name for name, value in wanted.items() if facts.get(name) != value), "")


def is_same(frame: Frame, request: Request) -> bool:
    """True if ``frame`` is the render of ``request``, on any device and in the layout that it needs."""
    request = dataclasses.replace(request, device=AUTO, layout=SUBPIXELS if request.layout == SUBPIXELS else LAYOUTS[0])
    return not first_difference(vars(frame), wanted_facts(request, frame))


def phrases(name: str, actual: object, wanted: object) -> tuple[str, str]:
    """Return both values of the fact ``name`` in words, as "scale 2" and "scale 4"; long ones are cut."""
    parts = _parts(actual), _parts(wanted)
    if name not in PLURAL and parts[0] and parts[0].keys() == parts[1].keys():
        # Displays have names; of other records and of tuples the part that differs is shown.
        part = first_difference(*parts)
        return phrases(f"{name} {part}".removesuffix(" name"), parts[0][part], parts[1][part])
    here, there = _phrase(name, actual), _phrase(name, wanted)
    return here if here != there else f"other {here}", there


def _parts(value: object) -> dict[str, object]:
    """Return the fields of a record, or the entries of a tuple by their numbers; nothing of other values."""
    if dataclasses.is_dataclass(value):
        return dict(vars(value))
    return {str(index): entry for index, entry in enumerate(value)} if isinstance(value, tuple) else {}


def _phrase(name: str, value: Any) -> str:
    words = LABELS.get(name, name.replace("_", " "))
    match name:
        case "samples":
            return f"{value}{SAMPLES}"
        case "lens_list":
            return f"{len(value)} lenses" if value else "all lenses"
        case "rows":
            return f"rows {rows_text(value)}" if value else "all rows"
        case "layers":
            value = ", ".join(value)
    if value is None or value is False or value == "":
        return f"no {words}"
    return words if value is True or dataclasses.is_dataclass(value) else f"{words} {value}"[:MOST_SHOWN]
