"""The folder of a plan's renders: a given one, else one in the user's cache until the plan is made."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import cache_folder, locks, read_json, write_json
from lfsr_core.base.notices import Notice, Tell
from lfsr_core.frames.folder import PLACES, digest, request_facts, scene_stamp
from lfsr_core.frames.request import Request
from lfsr_core.pipeline.staging import LOCK_FILE
from lfsr_core.plan.options import PlanOptions
from lfsr_core.plan.sample import lens_count
from lfsr_core.version import __version__

SAMPLE_FILE = "sample.json"
SECONDS_CACHED = 24 * 3600  # changes of textures and linked files are not noticed, so old renders are not reused


def sample_facts(request: Request, options: PlanOptions) -> dict[str, Any]:
    """JSON-ready facts that two plans must have in common to use the same renders."""
    return request_facts(request, (*PLACES, "sampling")) | {
        "lenses": lens_count(request.display, options), "reference_samples": options.reference_samples,
        "metric": options.metric}


def check_sample(folder: Path, request: Request, options: PlanOptions) -> None:
    """Describe the sample in ``folder``; LfsrError if the folder holds the sample of another scene or setting."""
    facts, path = sample_facts(request, options), folder / SAMPLE_FILE
    if path.exists() and read_json(path, "the description of a sample") != facts:
        raise LfsrError(f"{folder} holds the sample of another scene or of other options: choose another folder")
    write_json(path, facts)


@contextmanager
def work_folder(folder: Path | None, request: Request, options: PlanOptions, tell: Tell) -> Iterator[Path]:
    """Yield ``folder``, or one in the user's cache that is removed after the block.

    After an error or an interrupt the cached one stays, if a render was begun, for the next plan of the same question
    and scene file; a notice says so. Of two such plans at once the second works in a temporary folder.
    """
    if folder is not None:
        yield folder
        return
    plans = cache_folder() / "plans"
    for path in plans.iterdir() if plans.is_dir() else ():
        if time.time() - path.stat().st_mtime > SECONDS_CACHED:
            shutil.rmtree(path, ignore_errors=True)
    made = plans / digest([sample_facts(request, options), scene_stamp(request.scene), __version__])
    made.mkdir(parents=True, exist_ok=True)
    with (made / LOCK_FILE).open("ab") as lock:
        if not locks(lock):
            with tempfile.TemporaryDirectory(prefix="lfsr-plan-") as name:
                yield Path(name)
            return
        try:
            yield made
        except BaseException:
            if any(path.is_dir() for path in made.iterdir()):
                tell(Notice("plan-kept", {"folder": str(made)}))
            else:
                shutil.rmtree(made, ignore_errors=True)
            raise
        shutil.rmtree(made, ignore_errors=True)
