"""How the add-on's tasks start Blender."""

from __future__ import annotations

import dataclasses
from pathlib import Path


@dataclasses.dataclass(frozen=True)
class RenderCommand:
    """How the add-on starts renders: ``words``, then the job files; a render.blender.Starts."""

    words: tuple[str, ...]

    def command(self, *job_files: Path) -> list[str]:
        """Command line that runs ``job_files``."""
        return [*self.words, *map(str, job_files)]
