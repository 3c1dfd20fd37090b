"""How far a plan is, also within its renders."""

from __future__ import annotations

from lfsr_core.progress import Progress, silent

STAGE = "plan"


class Moving:
    """Progress of a plan in steps; while a render runs, its own progress moves that of the plan."""

    def __init__(self, progress: Progress = silent) -> None:
        """``progress`` is called with (stage, fraction, message)."""
        self._progress, self._message = progress, ""
        self._done, self._until, self._told = 0.0, 0.0, 0.0

    @classmethod
    def of(cls, progress: Progress | Moving) -> Moving:
        """``progress`` itself where it is one already, which renders tell too."""
        return progress if isinstance(progress, Moving) else cls(progress)

    def __call__(self, message: str, done: float, until: float | None = None) -> None:
        """A step begins at the share ``done`` of the plan and ends at ``until``."""
        self._message, self._done, self._until = message, done, done if until is None else until
        self._tell(done, message)

    def rendering(self, _stage: str, fraction: float, message: str) -> None:
        """A render of this step is at ``fraction``, as ``run_job`` tells it."""
        self._tell(self._done + fraction * (self._until - self._done), f"{self._message}: {message}")

    def _tell(self, fraction: float, message: str) -> None:
        self._told = max(self._told, min(fraction, 1.0))  # the first guesses at costs must not make it go back
        self._progress(STAGE, self._told, message)
