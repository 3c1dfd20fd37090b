"""The sentences of notices, as the command line shows them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lfsr_core.base.notices import Notice

REMEDIES = {"black": "make lights or exposure stronger", "white": "make lights or exposure weaker"}


def _subject_unseen(values: Mapping[str, Any]) -> str:
    shown = (f"background objects fill {values['background']:.0%} of the image" if values["background"]
             else "no object is in sight")
    return f"no lens sees the subject: {shown}"


def _frames(values: Mapping[str, Any]) -> str:
    return f"frames {', '.join(map(str, values['frames']))} were not averaged, because"


# By the code of a notice: a template for its values, or a function of them.
SENTENCES: dict[str, str | Callable[[Mapping[str, Any]], str]] = {
    "averaging-other-rays": lambda values: (
        f"{_frames(values)} their camera array or render settings differ: leave out --temporal-averaging while the "
        "camera array moves"),
    "averaging-same-seed": lambda values: (
        f"{_frames(values)} they have the same seed: render the animation with --temporal-averaging"),
    "denoised-on-cpu": "denoised on the CPU, since the {device} device of the render cannot be used here ({error}): "
                       "check its driver, or finish the frame where it was rendered",
    "frame-left-out": "frame {frame} is left out: {error}",
    "frames-older": lambda values: (
        ("1 frame is" if values["count"] == 1 else f"{values['count']} frames (from {values['first']}) are")
        + " older than this file. Use --overwrite to render them again"),
    "image-extreme": lambda values: (
        f"the image is almost {values['tone']}: {REMEDIES[values['tone']]}, or check where the camera looks"),
    "parts-kept": "Render again to continue, or delete {folder} to start over",
    "pixels-replaced": "{replaced} of {pixels} rendered pixels were not finite and are black: find the material or "
                       "light that makes them",
    "render-note": "{text}",
    "said": "{text}",
    "scale-chosen": "{reason}",
    "subject-unseen": _subject_unseen,
}


def sentence(notice: Notice) -> str:
    """Return the sentence of a notice."""
    found = SENTENCES[notice.code]
    return found.format(**notice.values) if isinstance(found, str) else found(notice.values)
