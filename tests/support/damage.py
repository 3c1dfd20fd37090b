"""Damage a file that a command reads, run the command, and judge the outcome; all of it decided by a seed."""

import contextlib
import faulthandler
import io
import itertools
import json
import os
import random
import re
import shutil
import signal
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from safetensors.numpy import load_file

from lfsr_core.base.messages import MOST_CHARACTERS, LfsrError
from lfsr_core.base.system import system_errors
from lfsr_core.cli import main
from lfsr_core.images.image_files import read_layers

MOST_SECONDS = 60
VALUES = ["", "\ud800", "x" * 5000, "../" * 50, -1, 0, 2**32, 10**400, 1e308, -0.0, None, True, [], {}, [[]] * 100,
          2**64, -2**70, 0.5, 3, "a", "\0", "$x^$", "a\\b", ["x"], {"x": 1}]
TOKENS = ["NaN", "-Infinity", "1e999", "9" * 400, "[" * 1000, '"\\ud800"', "0x1", "", "inf", "-1", "0", "true", "[]",
          "{}"]
# Outcomes: the first four are right.
REFUSED, SAME, READ, SAID = "refused", "same picture", "read", "another picture, said"
SILENT, TRACEBACK, HANG, UNCLEAR = "ANOTHER PICTURE", "TRACEBACK", "HANG", "NO SENTENCE"
WRONG = (SILENT, TRACEBACK, HANG, UNCLEAR)


class HangError(BaseException):
    """A command that takes too long; no code of ours catches it."""


@dataclass(frozen=True)
class Case:
    """A command, the good files that it reads, and the pictures that it makes of them."""

    make: Callable[[Path], object]  # fills a folder
    files: dict[str, str]  # kind of a file: its path in the folder
    run: Callable[[Path], list[str] | None]  # words of the command, or reads the files itself
    pictures: tuple[str, ...] = ()  # patterns of paths in the folder
    facts: frozenset[str] = frozenset()  # kinds without a checksum, whose change may be another valid file
    part: float = 1.0  # of as many inputs as others have, where a command is slow


@dataclass(frozen=True)
class Result:
    """What a command did."""

    outcome: str
    said: str  # sentence, or traceback
    pictures: tuple[bytes, ...] = ()


def places(data: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) inside JSON ``data``."""
    entries = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [place for key, value in entries for place in ((data, key), *places(value))]


def damaged(data: bytes, name: str, dice: random.Random) -> bytes:
    """A damaged copy of a file's content: as data, where it has that form, or byte by byte."""
    change = {".json": _json, ".toml": _line, ".cfg": _line, ".jsonl": _line}.get(Path(name).suffix)
    return change(data, dice) if change and dice.random() < 0.6 else _bytes(data, dice)


def damage(path: Path, dice: random.Random) -> None:
    """Damage a file in place, rarely by what is no file of its kind at all."""
    chosen, data = dice.random(), path.read_bytes()
    path.unlink()
    if chosen < 0.01:
        path.mkdir()
    elif chosen < 0.02:
        os.mkfifo(path)
    elif chosen < 0.03:
        path.symlink_to(path)
    elif chosen < 0.04:
        path.write_bytes(b"")
    elif chosen < 0.05:
        path.write_bytes(data)
        os.truncate(path, 2**36)
    elif chosen < 0.07:
        path.write_bytes(dice.randbytes(dice.randrange(2000)))
    else:
        path.write_bytes(damaged(data, path.name, dice))


def _json(data: bytes, dice: random.Random) -> bytes:
    content = json.loads(data)
    for _ in range(dice.randint(1, 3)):
        container, key = dice.choice(places(content) or [([0], 0)])
        if (change := dice.choice(["replace", "replace", "token", "remove", "add", "swap"])) == "remove":
            container.pop(key)
        elif change == "add" and isinstance(container, dict):
            container[dice.choice(["", "x", "__class__", "\ud800"])] = dice.choice(VALUES)
        elif change == "swap":
            other, there = dice.choice(places(content) or [([0], 0)])
            container[key] = json.loads(json.dumps(other[there]))
        else:
            container[key] = "TOKEN" if change == "token" else json.loads(json.dumps(dice.choice(VALUES)))
    return json.dumps(content).replace('"TOKEN"', dice.choice(TOKENS)).encode()


def _line(data: bytes, dice: random.Random) -> bytes:
    """Replace a value after = or : in one or two lines, or remove or double them."""
    lines = data.decode().splitlines()
    for _ in range(dice.randint(1, 2)):
        number = dice.randrange(len(lines)) if lines else 0
        change, value = dice.random(), dice.choice([*TOKENS, json.dumps(dice.choice(VALUES))])
        if change < 0.7:
            lines[number:number + 1] = [re.sub(r"([=:]\s*)[^,}]*", lambda match, new=value: match[1] + new,
                                               line, count=1) for line in lines[number:number + 1]]
        elif change < 0.85:
            del lines[number:number + 1]
        else:
            lines[number:number] = lines[number:number + 1]
    return "\n".join(lines).encode()


def _bytes(data: bytes, dice: random.Random) -> bytes:
    damaged = bytearray(data)
    for _ in range(dice.choice((1, 1, 1, 2, 4))):
        at = dice.randrange(min(len(damaged), 700) + 1 if dice.random() < 0.6 else len(damaged) + 1)
        piece = dice.choice([dice.randbytes(dice.randint(1, 8)), b"\xff" * 4, b"\0" * 4, b"\x7f\xff\xff\xff"])
        if (change := dice.choice(["set", "set", "flip", "flip", "cut", "double", "end"])) == "set":
            damaged[at:at + len(piece)] = piece
        elif change == "flip":
            damaged[at:at + 1] = bytes(byte ^ 1 << dice.randrange(8) for byte in damaged[at:at + 1])
        elif change == "cut":
            del damaged[at:at + len(piece)]
        elif change == "double":
            damaged[at:at] = damaged[at:at + 50]
        else:
            del damaged[at:]
    return bytes(damaged)


def attempt(case: Case, folder: Path) -> Result:
    """Run a case's command on the files in ``folder``; a library may take the end of a long wait for a bad file."""
    with _alarm() as rung:
        result = _attempt(case, folder)
    return Result(HANG, f"more than {MOST_SECONDS} s, then {result.said}") if rung else result


def _attempt(case: Case, folder: Path) -> Result:
    output, errors = io.StringIO(), io.StringIO()
    try:
        # system_errors: in which every program of ours reads
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors), system_errors():
            words = case.run(folder)
            code = main(words) if words else 0
    except LfsrError as error:  # of a reader
        code, words = 2, None
        errors.write(str(error))
    except BaseException:
        return Result(TRACEBACK, traceback.format_exc())
    lines = errors.getvalue().splitlines()
    if code:
        said = lines[-1] if lines else ""
        whole = 0 < len(said) <= MOST_CHARACTERS + 20 and (not words or said.startswith(f"lfsr {words[0]}: "))
        return Result(REFUSED if whole and code == 2 and "Traceback" not in errors.getvalue() else UNCLEAR,
                      said if whole else f"exit {code}: {errors.getvalue()}")
    notes = "\n".join(line for line in lines if line.startswith("note: "))
    return Result(READ, notes, tuple(pixels(path) for pattern in case.pictures
                                     for path in sorted(folder.glob(pattern))))


def judged(case: Case, kind: str, good: Result, damaged: Result) -> Result:
    """What became of the pictures, where the command made any."""
    if damaged.outcome != READ or not case.pictures or kind in case.facts:
        return damaged
    if damaged.pictures == good.pictures:
        return Result(SAME, damaged.said)
    return Result(SAID if damaged.said and damaged.said != good.said else SILENT, damaged.said)


def outcomes(case: Case, folder: Path, inputs: int, seed: object) -> Iterator[tuple[str, int, Result]]:
    """Kind, number and result of each of so many damaged copies of every file of a case."""
    good, work = folder / "good", folder / "work"
    work.mkdir(parents=True)
    with contextlib.redirect_stdout(io.StringIO()):
        case.make(work)  # where it is read, because some files hold paths
    shutil.copytree(work, good)
    first = attempt(case, work)
    assert first.outcome == READ, first.said
    for kind, number in itertools.product(case.files, range(inputs)):
        shutil.rmtree(work)
        shutil.copytree(good, work)
        damage(work / case.files[kind], random.Random(f"{seed} {kind} {number}"))
        yield kind, number, judged(case, kind, first, attempt(case, work))


@contextlib.contextmanager
def _alarm() -> Iterator[list[int]]:
    rung = list[int]()

    def end(number: int, _: Any) -> None:
        rung.append(number)
        raise HangError

    before = signal.signal(signal.SIGALRM, end)
    signal.alarm(MOST_SECONDS)
    faulthandler.dump_traceback_later(2 * MOST_SECONDS, exit=True)  # where a library waits, no exception is raised
    try:
        yield rung
    finally:
        signal.alarm(0)
        faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGALRM, before)


def pixels(path: Path) -> bytes:
    """Pixels of a picture, or the bytes of another file."""
    if path.suffix == ".exr":
        return read_layers(path)["color"].tobytes()
    if path.suffix == ".safetensors":  # the order in its header is random
        return b"".join(tensor.tobytes() for _, tensor in sorted(load_file(path).items()))
    return np.asarray(Image.open(path)).tobytes() if path.suffix in (".png", ".webp") else path.read_bytes()
