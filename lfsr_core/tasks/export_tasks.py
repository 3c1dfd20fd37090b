"""The tasks of the add-on that hand a finished frame on."""

from __future__ import annotations

from typing import Any

from lfsr_core.render.protocol import emit, emit_progress


def view(folder: str) -> dict[str, Any]:
    """Write the viewer of a finished frame folder; its "path"."""
    from lfsr_core.exports.page import write_page

    page = write_page([folder], progress=emit_progress)
    _warn(page.notes)
    return {"path": str(page.path)}


def export(folder: str, name: str, target: str, type: str | None = None) -> dict[str, Any]:
    """Write a finished frame folder in format ``name`` into ``target``; the "first" of its files and their "count"."""
    from lfsr_core.exports.formats import export as write
    from lfsr_core.exports.options import ExportOptions

    files, notes = write(folder, name, target, ExportOptions(type=type, progress=emit_progress))
    _warn(notes)
    return {"first": str(files[0]), "count": len(files)}


def _warn(notes: object) -> None:
    for note in notes:
        emit(stage="export", fraction=0.0, message=note, warning=True)
