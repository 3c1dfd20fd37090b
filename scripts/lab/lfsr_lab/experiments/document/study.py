"""Every study, measured as far as it is not, as one report with a manifest.

--short: every study on tiny frames, half an hour on two cores; --long: as the documents quote it, days; --draw: only
draw again what is measured in OUT. Machines may share OUT.
"""

import argparse
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import read_json, write_json
from lfsr_core.commands.common import names
from lfsr_lab.experiments.document.work import (
    FORMS,
    IMAGES,
    LONG,
    MEASURED,
    SHORT,
    Kept,
    Study,
    Unit,
    Work,
    commit,
    digests,
    inputs,
    read_table,
    record_facts,
    units,
)
from lfsr_lab.experiments.engine.records import to_stderr

MANIFEST = "manifest.json"
KEPT = "kept"  # form of a folder in which nothing is measured, such as docs/results
WORDS = {KEPT: "Drawn from the records that the documents quote, each measured as its command says."}
SECONDS_ARE_ROUGH = "Seconds on a busy machine mean little; the load says how busy it was."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    how = parser.add_mutually_exclusive_group(required=True)
    how.add_argument("--short", action="store_true", help="every study on tiny frames: half an hour on two cores")
    how.add_argument("--long", action="store_true", help="as the documents quote it: days")
    how.add_argument("--draw", action="store_true", help="only draw again what is measured in OUT")
    parser.add_argument("--only", type=names, metavar="NAME,NAME", help="studies to measure; default: all")
    parser.add_argument("--part", type=_part, metavar="I/N", help="measure only every N-th unit, from the I-th on")
    parser.add_argument("--assets", type=Path, metavar="DIR", help="scenes of other people, named in document.toml")


def run(arguments: argparse.Namespace) -> None:
    """Measure what is missing, draw, and print the paths of manifest and report."""
    table = read_table()
    work = Work(arguments.output, table, arguments.assets, arguments.blender)
    chosen = table.chosen(arguments.only)
    if not arguments.draw:
        measure(work, SHORT if arguments.short else LONG, chosen, arguments.part)
    for path in draw(work):
        print(path)


def _part(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)/(\d+)", text)
    index, count = map(int, match.groups()) if match else (0, 0)
    if not 1 <= index <= count:
        raise argparse.ArgumentTypeError(f"{text!r} is not a part such as 2/3: which one, and how many there are")
    return index, count


def measure(work: Work, form: str, studies: Sequence[Study], part: tuple[int, int] | None = None) -> None:
    """Measure the units of ``studies`` that are not whole; with ``part`` i of n only every n-th of them.

    LfsrError where the folder was begun in another form.
    """
    begun = _manifest(work.folder).get("form", form)
    if begun != form:
        how = "holds the records of the documents" if begun == KEPT else f"was begun with --{begun}"
        raise LfsrError(f"{work.folder} {how}: choose another folder for --{form}")
    write_json(work.folder / MANIFEST, _manifest(work.folder) | {"form": form})
    index, count = part or (1, 1)
    work.run(units(studies, form)[index - 1::count])


def draw(work: Work) -> Iterator[Path]:
    """Join records, write manifest and report, and yield their paths; errors as of ``page.write``."""
    from lfsr_lab.experiments.document import page  # draws by the code of every study, which is slow to load

    before = _manifest(work.folder)
    form = before.get("form", KEPT)
    every = [] if form == KEPT else units(work.table.study, form)
    work.gather(every)
    finished = {unit: ended for unit in every if (ended := work.ended(unit))}
    if not (rows := [*_records(work, form)]) and form == KEPT:
        raise LfsrError(f"{work.folder} holds no records to draw: measure some first, with --short or --long")
    asset_digests = {name: files for ended in finished.values() for name, files in ended.inputs.items()}
    if work.assets is not None:
        asset_digests |= {asset.name: digests(path) for asset in work.table.asset
                          if not asset.script and (path := work.assets / asset.file).is_file()}
    facts = {"form": form, "words": WORDS.get(form) or f"The {form} form: {FORMS[form]}. {SECONDS_ARE_ROUGH}",
             "commit": None if form == KEPT else commit(), "units": [
                 {"unit": unit.title, "state": (ended.sentence or "whole") if ended else "not measured",
                  "seconds": ended.seconds if ended else None, "load": ended.load if ended else None,
                  "threads": ended.threads if ended else "", "machine": ended.environment.machine if ended else "",
                  "command": ended.command if ended else ""} for unit in every for ended in [finished.get(unit)]],
             "inputs": inputs(work.table, asset_digests, before.get("inputs", [])),
             "records": [record_facts(work.folder / MEASURED / kept.file, kept.command) for _, kept in rows]}
    write_json(work.folder / MANIFEST, facts)
    yield work.folder / MANIFEST
    images = next((path for path in (work.folder / IMAGES, work.folder.parent / IMAGES) if path.is_dir()), Path())
    drawn = [page.section(study, kept, work.folder / MEASURED / kept.file, images) for study, kept in rows]
    yield page.write(work.folder, facts, drawn)
    printed = page.print_pdf(work.folder / page.PAGE)
    if printed is None:
        to_stderr("no browser of the Chromium family was found: report.pdf is not printed")
    else:
        yield printed


def _records(work: Work, form: str) -> Iterator[tuple[Study, Kept]]:
    """Yield study and description of every record that is there: of this form, or those that the documents quote."""
    for study in work.table.study:
        every = list(study.kept) if form == KEPT else []
        if form != KEPT and (names := ",".join(unit.name for unit in units([study], form))):
            every = [Kept(f"{study.name}.json", study.title, work.shown(Unit(study, names, form)), study.kind)]
        for kept in every:
            if (work.folder / MEASURED / kept.file).exists():
                yield study, kept


def _manifest(folder: Path) -> dict[str, Any]:
    path = folder / MANIFEST
    return read_json(path, "a manifest") if path.exists() else {}
