"""One finding of the scene check, and several of a kind as one row: "4,998 objects are too thin"."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

ERROR, WARNING, INFO = SEVERITIES = ("ERROR", "WARNING", "INFO")
MOST_ROWS = 5  # that are shown at first
# Title and reason of several findings of a kind, by their code.
SEVERAL = {
    "thin": ("{} objects are too thin", "They are thinner than what the rendered views show at their depths. Choose a "
             "smaller scale or move them nearer to the display plane."),
    "depth": ("{} objects leave the usable depth", "The display blurs what is nearer or farther than the orange "
              "rectangles. Move them, or move the display plane."),
    "background": ("{} objects fill the display", "Every lens counts as foreground. Objects in a collection called "
                   "Background are reconstructed faster."),
    "texture": ("{} files are missing", "What needs them looks wrong."),
    "eevee": ("{} materials have nodes of EEVEE", "Cycles, with which light fields are rendered, shows them black: "
              "connect shaders of Cycles."),
    "dirty": ("{} images have unsaved changes", "The render would not show them."),
    "script": ("{} materials have Script nodes", "Script nodes need the CPU or OptiX as device, and Open Shading "
               "Language switched on in Render Properties.")}


@dataclasses.dataclass(frozen=True)
class Problem:
    """One finding of the scene check."""

    code: str  # kind of problem, and key of its fix in ``fixes.FIXES`` or ``fixes.OPERATORS``
    target: str  # name of the object, image or setting
    reason: str  # a sentence for the artist
    fix: str = ""  # text of the button that removes the problem, empty for no button
    severity: str = WARNING
    is_object: bool = False  # whether ``target`` is an object that can be selected
    title: str = ""  # shown instead of ``target``
    asks: bool = False  # whether a render is started only after the artist was asked
    count: int = 1  # of the findings that a row stands for


def grouped(problems: Iterable[Problem]) -> list[Problem]:
    """Return the rows of ``problems``, worst first, else in their order; a row of several has no ``target``."""
    kinds: dict[tuple[str, ...], list[Problem]] = {}
    for problem in problems:
        key = (problem.code,) if problem.code in SEVERAL else (problem.code, problem.target, problem.reason)
        kinds.setdefault(key, []).append(problem)
    rows = []
    for first, *others in kinds.values():
        row = dataclasses.replace(first, title=first.title or first.target)
        if others:
            (title, reason), count = SEVERAL[first.code], 1 + len(others)
            row = dataclasses.replace(row, title=title.format(f"{count:,}"), reason=reason, target="", count=count)
        rows.append(row)
    return sorted(rows, key=lambda row: SEVERITIES.index(row.severity))
