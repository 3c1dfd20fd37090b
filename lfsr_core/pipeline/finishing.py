"""Finish a rendered frame folder in place."""

from __future__ import annotations

from pathlib import Path

from lfsr_core.base.files import replace_files, system_errors
from lfsr_core.base.notices import Progress, Tell, silent
from lfsr_core.frames.finish import Finish, Report, write_report
from lfsr_core.frames.frame import EIA_FILE, EIA_LINEAR_FILE, MASK_FILE, PANEL_FILE, read_rendered
from lfsr_core.pipeline.staging import staging_folder
from lfsr_core.reconstruct.second_stage import finish_into
from lfsr_core.reconstruct.upscaler import Upscaler

FINISHED_FILES = (EIA_FILE, EIA_LINEAR_FILE, MASK_FILE, PANEL_FILE)


def finish_frame(folder: str | Path, finish: Finish | str, tell: Tell = silent, *, step: int | None = None,
                 selection: bool = True, upscaler: Upscaler | None = None) -> Report:
    """Finish a rendered frame folder: write the images of ``finish_into`` and report.json, and return the report.

    LfsrError for bad input, or where another process writes into the folder; all files are replaced together or none.
    ``step``, ``selection``, ``upscaler``: for the laboratory, see ``reconstruct.second_stage``.
    """
    folder = Path(folder)
    direct = read_rendered(folder).subpixels is not None
    with staging_folder(folder) as staging, system_errors(folder):
        staged = staging / "finished"
        staged.mkdir()
        report = finish_into(folder, staged, finish, tell, step=step, selection=selection, upscaler=upscaler)
        write_report(staged, report)
        replace_files(staged, folder, () if direct else FINISHED_FILES)
    tell(Progress("write", 1.0, PANEL_FILE if direct else EIA_FILE))
    return report
