"""What long work has told."""

from __future__ import annotations

from lfsr_core.base.notices import Notice, Progress


class Told:
    """A ``Tell`` that keeps everything."""

    def __init__(self) -> None:
        self.progress: list[Progress] = []
        self.notices: list[Notice] = []

    def __call__(self, told: Progress | Notice) -> None:
        """Keep it."""
        if isinstance(told, Notice):
            self.notices.append(told)
        else:
            self.progress.append(told)
