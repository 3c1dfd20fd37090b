"""Measure units: each is claimed by a lock, run as a command of its own, and recorded when that has ended.

    DIR/STUDY/UNIT/          what the unit's command writes, log.txt, and unit.json when it has ended
    DIR/scenes/              scenes that scripts make
    DIR/measured/STUDY.json  what the units of a study measured, joined

Whoever holds the lock DIR/STUDY/UNIT.lock measures the unit. The command inherits the lock, so that the unit stays
claimed while its command lives, even where this process was killed.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from lfsr_core.base.messages import LfsrError, did_you_mean, duration
from lfsr_core.base.records import from_data, read_record, write_record
from lfsr_core.base.system import atomic_path, locks, read_json, replace, write_json
from lfsr_core.process.child import START, ProcessGroup, find_blender
from lfsr_lab.experiments.engine.records import to_stderr
from lfsr_lab.experiments.engine.report import Environment, environment, load_average
from lfsr_lab.scenes import run_script, scene_script

TABLE = Path(__file__).parent / "document.toml"
SHORT, LONG = "short", "long"
FORMS = {SHORT: "tiny frames and few samples: it shows that everything runs, and decides nothing",
         LONG: "the sizes and samples that the documents quote"}


@dataclasses.dataclass(frozen=True)
class Asset:
    """A scene: a file of other people below the folder of assets, or one that a script of the laboratory makes."""

    name: str
    file: str  # below the folder of assets, or of the made scenes
    licence: str
    source: str
    script: str = ""  # of lfsr_lab.scenes, that makes it
    argument: str = ""  # of the script, below the folder that it writes into


@dataclasses.dataclass(frozen=True)
class Form:
    """How a study is measured: a command per unit, each of which one process measures at a time.

    In a command {out} is the unit's own folder, {all} that of all studies, {assets} that of the assets, {here} that of
    document.toml, {unit} the unit's name, and {NAME} the file of an asset, {scene} that of the asset named like the
    unit.
    """

    command: str
    minutes: float  # of each unit on two cores, as far as it is known
    units: tuple[str, ...] = ("all",)  # names of the units
    assets: tuple[str, ...] = ()  # that every unit needs
    after: str = ""  # study whose units it reads


@dataclasses.dataclass(frozen=True)
class Kept:
    """A record that was measured before: of an older release, or in another way."""

    file: str  # below the folder of records
    title: str
    command: str
    kind: str = ""  # of its figures, where it is not the study's


@dataclasses.dataclass(frozen=True)
class Study:
    name: str
    kind: str  # of its figures, see figures.py
    title: str
    question: str
    record: str  # file that a unit leaves in its folder
    joined: str = ""  # list or object in it that grows with the units; with one unit there is none
    short: Form | None = None
    long: Form | None = None
    kept: tuple[Kept, ...] = ()


@dataclasses.dataclass(frozen=True)
class Unit:
    """One piece of a study, the least that is claimed."""

    study: Study
    name: str
    length: str  # SHORT or LONG

    @property
    def form(self) -> Form:
        form: Form = getattr(self.study, self.length)
        return form

    @property
    def title(self) -> str:
        return f"{self.study.name}/{self.name}"

    def assets(self, table: Table) -> list[Asset]:
        by_name = {asset.name: asset for asset in table.asset}
        own = (self.name,) if "{scene}" in self.form.command else ()
        return [by_name[name] for name in (*own, *self.form.assets)]


@dataclasses.dataclass(frozen=True)
class Table:
    asset: tuple[Asset, ...]
    study: tuple[Study, ...]

    def chosen(self, names: Sequence[str] | None) -> list[Study]:
        """Return the studies of these names, all for None; LfsrError for an unknown name."""
        by_name = {study.name: study for study in self.study}
        for name in names or ():
            if name not in by_name:
                raise LfsrError(f"there is no study {name!r}; {did_you_mean(name, by_name)}choose from "
                                f"{', '.join(by_name)}")
        return [study for study in self.study if names is None or study.name in names]


def read_table(path: Path = TABLE) -> Table:
    try:
        return from_data(Table, tomllib.loads(path.read_text(encoding="utf-8")), str(path))
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise LfsrError(f"{path} cannot be read as a table of studies ({error}): check the file") from None


def units(studies: Iterable[Study], length: str) -> list[Unit]:
    """Return the units of a form, in the order in which they are measured."""
    return [Unit(study, name, length) for study in studies if getattr(study, length)
            for name in getattr(study, length).units]


Digests = dict[str, str]  # SHA-256 by the file's path below the asset's folder
BESIDE = (".gltf", ".obj")  # scenes whose other files lie beside them


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, as the program sha256sum prints it."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digests(scene: Path) -> Digests:
    """Return the digest of an asset's file, and of all files in its folder where it is not of one file."""
    folder = scene.parent
    files = sorted(path for path in folder.rglob("*") if path.is_file()) if scene.suffix in BESIDE else [scene]
    return {path.relative_to(folder).as_posix(): sha256(path) for path in files}


def inputs(table: Table, digests: Mapping[str, Digests], before: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return name, licence, source and digests of every asset that was read, now or by an earlier manifest."""
    files = {entry["name"]: entry["files"] for entry in before} | dict(digests)
    return [{"name": asset.name, "licence": asset.licence, "source": asset.source, "files": files[asset.name]}
            for asset in table.asset if asset.name in files]


def record_facts(path: Path, command: str) -> dict[str, Any]:
    """Return digest, command, machine and seeds of a record."""
    try:
        data = read_json(path, "a record")
    except LfsrError:  # a page, or damaged: its section says so
        data = None
    machine = (data.get("environment") if isinstance(data, dict) else None) or {}
    parts = [f"{machine['cores']} cores" if "cores" in machine else "", machine.get("cpu") or machine.get("machine"),
             machine.get("system"),
             ", ".join(f"{name} {number}" for name, number in machine.get("versions", {}).items())]
    return {"file": path.name, "command": command, "sha256": sha256(path), "machine": ", ".join(filter(None, parts)),
            "seeds": sorted(set(_seeds(data)))}


def commit() -> str | None:
    """Return the commit of the clone that this is, None where it is none."""
    try:
        ended = subprocess.run(["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty"], check=True,
                               capture_output=True, text=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return ended.stdout.strip()


def _seeds(data: Any) -> Iterator[int]:
    """Yield every number called seed in a record, and those below a number of seeds."""
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        if key == "seed" and isinstance(value, int):
            yield value
        elif key == "seeds" and isinstance(value, int):
            yield from range(value)
        elif isinstance(value, (dict, list)):
            yield from _seeds(value)


UNIT_FILE, LOG_FILE, SCENES, MEASURED, IMAGES = "unit.json", "log.txt", "scenes", "measured", "images"
PROGRAMS = {"lfsr": ["-m", "lfsr_core"], "python": []}
SECONDS_TO_STOP, BETWEEN_LOOKS, LAST_WORDS = 20.0, 0.5, 300


@dataclasses.dataclass(frozen=True)
class Ended:
    command: str  # as a person would type it
    sentence: str  # why it failed, empty where it is whole
    seconds: float
    load: float | None  # load average of the machine when it ended
    threads: str  # what OMP_NUM_THREADS said, or the number of cores
    environment: Environment
    inputs: dict[str, Digests]  # digests of the files of every asset, by its name


@dataclasses.dataclass(frozen=True)
class Work:
    """A folder in which studies are measured, by any number of processes."""

    folder: Path
    table: Table
    assets: Path | None = None  # folder of scenes of other people
    blender: str | None = None

    def run(self, units: Sequence[Unit]) -> None:
        """Measure all units that are not whole and that nobody else measures; a unit that fails keeps its sentence."""
        left = [unit for unit in units if not self.is_whole(unit)]
        for index, unit in enumerate(left):
            minutes = sum(remaining.form.minutes for remaining in left[index:])
            to_stderr(f"{unit.title}: {index + 1} of {len(left)}, about {duration(60 * minutes)} left on two cores")
            with _claimed(self._folder(unit)) as lock:
                if lock is None:
                    to_stderr(f"{unit.title}: another process measures it")
                elif not self.is_whole(unit):  # another may have ended it meanwhile
                    self._record(unit, lock)

    def ended(self, unit: Unit) -> Ended | None:
        """Return what is known of a unit, None where its command has not ended or was another one."""
        path = self._folder(unit) / UNIT_FILE
        record = read_record(path, Ended, "the end of a unit") if path.exists() else None
        return record if record and record.command == self.shown(unit) else None

    def is_whole(self, unit: Unit) -> bool:
        ended = self.ended(unit)
        return ended is not None and not ended.sentence

    def shown(self, unit: Unit) -> str:
        """Return its command as a person would type it, without this machine's folders."""
        files = {asset.name: Path(asset.file).name for asset in self.table.asset} | {",".join(unit.form.units): "SCENE"}
        return _filled(unit, files, {"out": "DIR", "all": "ALL", "assets": "ASSETS", "here": "document"})

    def gather(self, units: Sequence[Unit]) -> None:
        """Write DIR/measured/STUDY.json of every study that has whole units, and copy their images to DIR/images."""
        for study in dict.fromkeys(unit.study for unit in units):
            folders = [self._folder(unit) for unit in units if unit.study == study and self.is_whole(unit)]
            if folders:
                whole = joined(study, [folder / study.record for folder in folders])
                write_json(self.folder / MEASURED / f"{study.name}.json", whole)
            for image in (image for folder in folders for image in (folder / IMAGES).glob("*.png")):
                with atomic_path(self.folder / IMAGES / image.name) as temporary:
                    shutil.copyfile(image, temporary)

    def _record(self, unit: Unit, lock: IO[bytes]) -> None:
        """Measure a unit, and store that it is whole or why it is not."""
        started, sentence, files = time.monotonic(), "", dict[str, Path]()
        before = units((study for study in self.table.study if study.name == unit.form.after), unit.length)
        try:
            for other in before:
                if self.ended(other) is None:
                    raise LfsrError(f"it needs {other.title}, which has not ended: run the command again after that")
            files = {asset.name: self._file(asset) for asset in unit.assets(self.table)}
            if "{assets}" in unit.form.command and self.assets is None:
                raise LfsrError("it needs scenes of other people: give their folder with --assets")
            folders = {"out": self._folder(unit), "all": self.folder, "assets": self.assets or "", "here": TABLE.parent}
            program, *words = shlex.split(_filled(unit, {name: path.resolve() for name, path in files.items()},
                                                  {name: Path(path).resolve() for name, path in folders.items()}))
            command = [sys.executable, *PROGRAMS[program], *words]
            if self.blender:
                command += ["--blender", self.blender]
            log = self._folder(unit) / LOG_FILE
            inherited: dict[str, Any] = {} if sys.platform == "win32" else {"pass_fds": (lock.fileno(),)}
            process = subprocess.Popen(list(command), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                       stderr=subprocess.STDOUT, text=True, encoding="utf-8", errors="replace",
                                       **inherited, **START,
                                       env={**os.environ, "PYTHONUNBUFFERED": "1", "PYTHONIOENCODING": "utf-8"})
            group, last = ProcessGroup(process, low_priority=False), ""
            assert process.stdout is not None
            try:
                with log.open("a", encoding="utf-8") as kept:
                    for line in process.stdout:
                        kept.write(line)
                        to_stderr(line.rstrip())
                        last = line.strip() or last
                code = process.wait()
            finally:
                if process.poll() is None:  # cancelled: it may end what it has begun
                    process.send_signal(signal.SIGTERM)
                    with contextlib.suppress(subprocess.TimeoutExpired):
                        process.wait(SECONDS_TO_STOP)
                group.kill()
            if code:
                raise LfsrError(last[-LAST_WORDS:] or f"it ended with exit code {code}")
            if not (self._folder(unit) / unit.study.record).exists():
                raise LfsrError(f"{unit.study.record} was not written: {last[-LAST_WORDS:] or 'nothing was printed'}")
        except LfsrError as error:
            sentence = str(error)
            to_stderr(f"{unit.title}: {sentence}")
        asset_digests = {name: digests(path) for name, path in files.items()}
        allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
        write_record(self._folder(unit) / UNIT_FILE,
                     Ended(self.shown(unit), sentence, round(time.monotonic() - started, 1), load_average(),
                           os.environ.get("OMP_NUM_THREADS") or str(allowed), environment(), asset_digests))

    def _file(self, asset: Asset) -> Path:
        """Return the file of an asset, made now where a script makes it; LfsrError where it is missing."""
        if not asset.script:
            path = (self.assets or Path()) / asset.file
            if self.assets is None or not path.is_file():
                raise LfsrError(f"{asset.name} is not there ({asset.file}; {asset.licence}; {asset.source}): put it "
                                "below the folder that --assets names")
            return path
        path = self.folder / SCENES / asset.file
        with contextlib.ExitStack() as held:
            while held.enter_context(_claimed(self.folder / SCENES)) is None:
                held.close()
                time.sleep(BETWEEN_LOOKS)
            if not path.exists():
                with tempfile.TemporaryDirectory(prefix=".making-", dir=path.parent) as name:
                    made = Path(name, asset.file)
                    run_script(find_blender(self.blender), scene_script(asset.script), Path(name, asset.argument),
                               [made])
                    for blend in Path(name).glob("*.blend"):
                        replace(blend, path.parent / blend.name)
        return path

    def _folder(self, unit: Unit) -> Path:
        return self.folder / unit.study.name / unit.name


def joined(study: Study, paths: Sequence[Path]) -> Any:
    """Return the records of a study's units as one: of the first, with the joined part of the others."""
    whole, *others = (read_json(path, "a record") for path in paths)
    for other in others:
        part = other[study.joined]
        if isinstance(part, dict):
            whole[study.joined] |= part
        else:
            whole[study.joined] += part
    return whole


def _filled(unit: Unit, files: Mapping[str, object], folders: Mapping[str, object]) -> str:
    """Return the command with files and folders; quoted where that is needed."""
    values = {**files, **folders, "unit": unit.name, "scene": files.get(unit.name, "")}
    return unit.form.command.format_map({name: shlex.quote(str(value)) for name, value in values.items()})


@contextlib.contextmanager
def _claimed(folder: Path) -> Iterator[IO[bytes] | None]:
    """Yield the lock of a unit's folder, None where another process has it."""
    folder.mkdir(parents=True, exist_ok=True)
    with folder.with_name(f"{folder.name}.lock").open("ab") as lock:
        yield lock if locks(lock) else None
