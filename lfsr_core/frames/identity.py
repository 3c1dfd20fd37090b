"""What decides the pixels of a render, in what two renders differ first, and which version of a scene they show."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import file_stamp, system_errors
from lfsr_core.base.records import to_data
from lfsr_core.frames.frame import LAYOUTS, SUBPIXELS, Frame, read_part
from lfsr_core.frames.request import AUTO, Request
from lfsr_core.optics.lens_rows import rows_text

Facts = Mapping[str, object]  # what decides pixels, by name
# Facts of the rays and their number; a render's folder is compared by these unless more are asked for.
RAYS = ("display", "convention", "layout", "lens_list", "rows", "scale", "samples")
PLACES = ("output", "parts", "world", "source")  # fields of a job that are paths, on which no pixel depends
PLURAL = ("samples", "lens_list", "rows", "layers")
SAMPLES = " samples per pixel"
FARM_COPY = ".farm"  # ends the name of the copy of a file that a farm renders
LABELS = {"world_visible": "visible world", "world_apart": "world image", "matrix_world": "camera placement",
          "frame": "frame number"}
DIGEST_SIZE, MOST_SHOWN = 12, 60  # bytes, characters
COMPANIONS = (".bin", ".mtl")  # of a scene, beside .gltf and .obj
BETWEEN = "; "  # stamps of files


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


def request_facts(job: Request, free: Collection[str] = PLACES) -> dict[str, Any]:
    """Return the fields of a job, JSON-ready, without those named in ``free``."""
    return {name: value for name, value in to_data(job).items() if name not in free}


def wanted_facts(job: Request, found: Frame, content: str = "") -> Facts:
    """Return the fields that a frame must have to be the render of ``job``.

    The values of ``found`` stand for what the job leaves open, such as the device or the choice of a scale; a
    reference may have other samples and lenses than its job. ``content``: stamp of the scene's file, empty for any.
    """
    is_reference, sampling = job.kind == "reference", job.sampling
    scale = found.scale if found.scale in sampling.scales else sampling.scale
    is_open_layout = job.layout == LAYOUTS[0] and found.layout != SUBPIXELS  # some devices need the lens card
    return {"display": job.display,
            "scale": scale,
            "samples": found.samples if is_reference else job.samples_at(scale),
            "layout": found.layout if is_open_layout else job.layout,
            "convention": job.convention,
            "view_aperture": job.view_aperture,
            "lens_list": found.lens_list if is_reference else job.lens_list,
            "rows": job.rows,
            "frame": found.frame if job.frame is None else job.frame,
            "seed": job.seed,
            "subject": job.subject or "",
            "scene_name": job.scene_name if job.scene_name and found.scene_name else found.scene_name,
            "source": found.source if is_of(found, job.source) else job.source,
            "camera": job.camera or "",
            "device": found.device if job.device == AUTO else job.device,
            "light": found.light if job.light == AUTO or not found.light else job.light,
            "world_visible": found.world_visible if job.world_visible is None else job.world_visible,
            "layers": found.layers if set(job.layers) <= set(found.layers) else job.layers,
            "content": content if is_changed(found.content, content) else found.content}


def is_of(frame: Frame, source: str, scene_name: str = "") -> bool:
    """True if ``frame`` may be a render of the file ``source``, as of ``Frame.source``, and of the scene in it.

    A frame that does not know its source, such as that of a farm, is known by its file's name; "" is any.
    """
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


def first_difference(found: Facts, wanted: Facts) -> str:
    """Return the name of the first of the ``wanted`` facts that is another in ``found``, "" where there is none."""
    return next((name for name, value in wanted.items() if found.get(name) != value), "")


def is_same(frame: Frame, job: Request) -> bool:
    """True if ``frame`` is the render of ``job``, on any device and in the layout that it needs."""
    layout = job.layout if job.layout == SUBPIXELS else LAYOUTS[0]
    return not first_difference(vars(frame), wanted_facts(dataclasses.replace(job, device=AUTO, layout=layout), frame))


def check_same(folder: Path, job: Request, content: str = "", names: Collection[str] | None = RAYS,
               advice: str = "choose another folder") -> None:
    """LfsrError with the first difference unless ``folder`` holds the render of ``job``, or a part of it.

    ``content``: as of ``wanted_facts``; ``names``: facts to compare, None for all; ``advice``: what the user can do.
    """
    found = read_part(folder)
    facts = wanted_facts(job, found, content)
    wanted = {name: value for name, value in facts.items() if names is None or name in names}
    if name := first_difference(vars(found), wanted):
        if name == "content":
            raise LfsrError(f"{folder} was rendered before {found.scene} was changed: {advice}")
        here, there = phrases(name, vars(found)[name], wanted[name])
        verb = "were" if name in PLURAL else "was"
        raise LfsrError(f"{folder} was rendered with {here}, but {there.removesuffix(SAMPLES)} {verb} asked for: "
                        f"{advice}")


def phrases(name: str, found: object, wanted: object) -> tuple[str, str]:
    """Return both values of the fact ``name`` in words, as "scale 2" and "scale 4"; long ones are cut."""
    parts = _parts(found), _parts(wanted)
    if name not in PLURAL and parts[0] and parts[0].keys() == parts[1].keys():
        # Displays have names; of other records and of tuples the part that differs is shown.
        part = first_difference(*parts)
        return phrases(f"{name} {part}".removesuffix(" name"), parts[0][part], parts[1][part])
    here, there = _phrase(name, found), _phrase(name, wanted)
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
