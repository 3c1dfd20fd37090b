"""The record of one finding of the scene check."""

from __future__ import annotations

import dataclasses

ERROR, WARNING, INFO = SEVERITIES = ("ERROR", "WARNING", "INFO")


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
