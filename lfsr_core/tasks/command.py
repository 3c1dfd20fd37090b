"""The command of the add-on that starts Blender."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from lfsr_core.process.child import Child
from lfsr_core.process.protocol import LAST_STAGES, emit_told, told_of


@dataclasses.dataclass(frozen=True)
class RenderCommand:
    """Command of the add-on that starts Blender; a ``process.blender.Starts``."""

    words: tuple[str, ...]

    def command(self, *request_files: Path) -> list[str]:
        """Return the command line that renders ``request_files``."""
        return [*self.words, *map(str, request_files)]

    def run(self, *words: str) -> dict[str, Any]:
        """Run another job of Blender's, such as the encoding of a film; return what it answers."""
        with Child([*self.words, *words]) as child:
            for record in child.records():
                if record["stage"] not in LAST_STAGES and (told := told_of(record)) is not None:
                    emit_told(told)
            if not child.is_done():
                raise child.crash("Blender stopped with", "try again")
            return child.last
