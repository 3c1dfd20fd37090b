"""The folder of a plan's renders: a given one, else one in the user's cache until the plan is made."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lfsr_core.base.cache import cache_folder
from lfsr_core.base.files import locks
from lfsr_core.frames.identity import PLACES, digest, request_facts, scene_stamp
from lfsr_core.frames.request import Request
from lfsr_core.pipeline.staging import LOCK_FILE, has_parts
from lfsr_core.pipeline.store import Warn, is_complete
from lfsr_core.plan.options import PlanOptions
from lfsr_core.version import __version__

IGNORED = (*PLACES, "scale", "spp")  # fields of the job that is planned for
SECONDS_CACHED = 24 * 3600  # changes of textures and linked files are not noticed, so old renders are not reused


def sample_facts(job: Request, options: PlanOptions) -> dict[str, Any]:
    """JSON-ready facts that two plans must have in common to use the same renders."""
    wanted = {(candidate.scale, candidate.spp) for candidate in options.candidates(job.display)}
    return request_facts(job, IGNORED) | {
        "lenses": options.lenses, "share": options.budget, "reference_spp": options.reference_spp,
        "metric": options.metric, "renders": [list(pair) for pair in sorted(wanted)]}


@contextmanager
def work_folder(folder: Path | None, job: Request, options: PlanOptions, warn: Warn) -> Iterator[Path]:
    """Yield ``folder``, or one in the user's cache that is removed after the block.

    After an error or an interrupt the cached one stays, if it holds a finished render, for the next plan of the same
    question and scene file; ``warn`` says so. Of two such plans at once the second works in a temporary folder.
    """
    if folder is not None:
        yield folder
        return
    facts = [sample_facts(job, options), scene_stamp(job.scene), __version__]
    made = cache_folder() / "plans" / digest(facts)
    _sweep(made.parent)
    made.mkdir(parents=True, exist_ok=True)
    with (made / LOCK_FILE).open("ab") as lock:
        if not locks(lock):
            with tempfile.TemporaryDirectory(prefix="lfsr-plan-") as name:
                yield Path(name)
            return
        try:
            yield made
        except BaseException:
            _leave(made, warn)
            raise
        shutil.rmtree(made, ignore_errors=True)


def _leave(folder: Path, warn: Warn) -> None:
    if _has_renders(folder):
        warn(f"the renders of this plan stay for a day in {folder}: run the same plan again to continue")
    else:
        shutil.rmtree(folder, ignore_errors=True)


def _has_renders(folder: Path) -> bool:
    return any(has_parts(path) or any(is_complete(path, kind) for kind in ("render", "reference"))
               for path in folder.iterdir() if path.is_dir())


def _sweep(folder: Path) -> None:
    """Remove the renders of interrupted plans that are too old."""
    for path in folder.iterdir() if folder.is_dir() else ():
        if time.time() - path.stat().st_mtime > SECONDS_CACHED:
            shutil.rmtree(path, ignore_errors=True)
