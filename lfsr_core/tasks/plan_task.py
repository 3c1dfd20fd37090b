"""A plan for the add-on, in a process of its own: ``python -m lfsr_core.tasks.plan_task TASK.json``

It starts Blender for every render, so being told to stop must reach that too:
unlike the other tasks of the panel it is unwound, not ended on the spot.
Progress and result are lines as in ``panel_tasks``.
"""

from __future__ import annotations

import dataclasses
import os
import signal
import sys
import threading
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json
from lfsr_core.render.protocol import EXIT_BAD_INPUT, EXIT_CANCELLED, emit, emit_progress


@dataclasses.dataclass(frozen=True)
class RenderCommand:
    """How the add-on starts a render: ``words``, then the job file; stands for a blender_process.Blender."""

    words: tuple[str, ...]

    def command(self, job_file: Path) -> list[str]:
        """Command line that runs ``job_file``."""
        return [*self.words, str(job_file)]


def find(job: dict[str, Any], options: dict[str, Any], command: list[str], work: str) -> dict[str, Any]:
    """Plan for the scene of ``job`` (Job.to_dict) with ``options`` (plan_options.Options), rendered by ``command``.

    Result: "sentence", and "chosen" with scale, spp and method, None where nothing meets the target.
    """
    from lfsr_core.frames.job import Job
    from lfsr_core.plan.options import Options
    from lfsr_core.plan.planner import make_plan, rendering
    from lfsr_core.plan.report import sentence

    wanted = Options(**{name: tuple(value) if isinstance(value, list) else value for name, value in options.items()})
    render = rendering(RenderCommand(tuple(command)), _warn)
    planned = make_plan(Job.from_dict(job), wanted, render, Path(work), emit_progress)
    chosen = planned.choice.chosen
    return {"sentence": sentence(planned.choice, wanted),
            "chosen": chosen and dataclasses.asdict(chosen.candidate)}


def main(arguments: list[str]) -> int:
    """Run the task file named in ``arguments``; the process's exit code."""
    signal.signal(signal.SIGTERM, _stop)
    threading.Thread(target=_end_with_parent, daemon=True, name="lfsr-parent").start()
    try:
        result = find(**read_json(arguments[0], "a task of the add-on"))
    except LfsrError as error:
        emit(stage="error", message=str(error))
        return EXIT_BAD_INPUT
    except KeyboardInterrupt:
        return EXIT_CANCELLED
    emit(stage="done", **result)
    return 0


def _warn(message: str) -> None:
    emit(stage="plan", fraction=0.0, message=message, warning=True)


def _stop(_signal: int, _stack: object) -> None:
    raise KeyboardInterrupt


def _end_with_parent() -> None:
    while os.read(0, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
