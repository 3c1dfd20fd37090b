"""The table of studies, document.toml: which command measures what, in a short and a long form, of which scenes."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path

from lfsr_core.base.errors import LfsrError, did_you_mean
from lfsr_core.base.records import from_data

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
    document.toml, {each} the unit's name, and {NAME} the file of an asset, {scene} that of the asset named like the
    unit.
    """

    command: str
    minutes: float  # of each unit on two cores, as far as it is known
    each: tuple[str, ...] = ("all",)  # names of the units
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
        known = {asset.name: asset for asset in table.asset}
        own = (self.name,) if "{scene}" in self.form.command else ()
        return [known[name] for name in (*own, *self.form.assets)]


@dataclasses.dataclass(frozen=True)
class Table:
    asset: tuple[Asset, ...]
    study: tuple[Study, ...]

    def chosen(self, names: Sequence[str] | None) -> list[Study]:
        """Return the studies of these names, all for None; LfsrError for an unknown name."""
        known = {study.name: study for study in self.study}
        for name in names or ():
            if name not in known:
                raise LfsrError(f"there is no study {name!r}; {did_you_mean(name, known)}choose from "
                                f"{', '.join(known)}")
        return [study for study in self.study if names is None or study.name in names]


def read_table(path: Path = TABLE) -> Table:
    try:
        return from_data(Table, tomllib.loads(path.read_text(encoding="utf-8")), str(path))
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise LfsrError(f"{path} cannot be read as a table of studies ({error}): check the file") from None


def units(studies: Iterable[Study], length: str) -> list[Unit]:
    """Return the units of a form, in the order in which they are measured."""
    return [Unit(study, name, length) for study in studies if getattr(study, length)
            for name in getattr(study, length).each]
