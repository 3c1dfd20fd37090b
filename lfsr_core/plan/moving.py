"""Progress of a plan, within its renders too."""

from __future__ import annotations

from lfsr_core.progress import Progress, silent

STAGE = "plan"


class Moving:
    """Progress of a plan in steps; the progress of a render moves that of the plan."""

    def __init__(self, progress: Progress = silent) -> None:
        """``progress`` is called with (stage, fraction, message)."""
        self._progress, self._message = progress, ""
        self._done, self._until, self._shown = 0.0, 0.0, 0.0

    def __call__(self, message: str, done: float, until: float | None = None) -> None:
        """Begin a step at the fraction ``done`` of the plan, which ends at ``until``."""
        self._message, self._done, self._until = message, done, done if until is None else until
        self._show(done, message)

    def rendering(self, _stage: str, fraction: float, message: str) -> None:
        """Show that the render of this step is at ``fraction``: a progress for ``run_job``."""
        self._show(self._done + fraction * (self._until - self._done), f"{self._message}: {message}")

    def _show(self, fraction: float, message: str) -> None:
        self._shown = max(self._shown, min(fraction, 1.0))  # costs are guessed at first: never go back
        self._progress(STAGE, self._shown, message)
