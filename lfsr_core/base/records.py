"""Read frozen dataclasses from JSON, write them, and check their fields.

A field with ``metadata={"key": "name"}`` has another name in JSON than in Python. Values are checked and never
converted: a field holds the value in the data, or reading fails with one sentence.
"""

import dataclasses
import functools
import numbers
import re
import sys
import textwrap
import types
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from lfsr_core.base.messages import LfsrError, did_you_mean
from lfsr_core.base.system import read_json, write_json

Record = TypeVar("Record")
MOST_VALUE = 50  # characters of a value, or of a list of names, so that what is wrong fits beside a long path
MOST_TEXT, MOST_WHOLE = 4096, 2**63
SURROGATE = re.compile("[\ud800-\udfff]")  # JSON can hold these; file names and terminals cannot
PLAIN: dict[type, tuple[tuple[type, ...], str]] = {
    str: ((str,), "text"), bool: ((bool,), "true or false"), int: ((int,), "a whole number"),
    float: ((int, float), "a finite number")}


def from_data(cls: type[Record], data: Any, source: str) -> Record:
    """Return the record of class ``cls`` in JSON ``data``; ``source`` names the data in errors.

    LfsrError for an unknown or missing field, a value of another type, or a number that is not finite.
    """
    try:
        record: Record = _value(data, cls)
        return record
    except _WrongError as error:
        place = "".join(reversed(error.places)).removeprefix(".")
        rest = f"{place or 'it'} {error}" if error.of_value else f"{place}: {error}" if place else str(error)
    except LfsrError as error:  # a record's own check
        rest = str(error)
    raise LfsrError(f"{source}: {rest}")


def to_data(record: Any) -> Any:
    """Return the JSON-ready data of a record: objects, lists, text, numbers, true, false and null."""
    if dataclasses.is_dataclass(record):
        return {_key(field): to_data(getattr(record, field.name)) for field in dataclasses.fields(record) if field.init}
    if isinstance(record, Mapping):
        return {key: to_data(value) for key, value in record.items()}
    if isinstance(record, (list, tuple)):
        return [to_data(value) for value in record]
    return record.item() if getattr(record, "ndim", None) == 0 else record  # a number of NumPy's


def is_whole(value: object) -> bool:
    """Return True for a whole number, also one of NumPy's."""
    return isinstance(value, numbers.Integral) and not isinstance(value, bool)


def read_record(path: str | Path, cls: type[Record], what: str) -> Record:
    """Read a record from a JSON file; LfsrError says ``what`` was expected, or what is wrong in it."""
    return from_data(cls, read_json(path, what), str(path))


def write_record(path: str | Path, record: Any) -> None:
    """Write a record as JSON, whole or not at all; LfsrError where ``read_record`` could not read it."""
    data = to_data(record)
    from_data(type(record), data, str(path))
    write_json(path, data)


def fail(field: str, value: Any, rule: str) -> NoReturn:
    """LfsrError that names a field, its value and the rule that it breaks."""
    raise LfsrError(f"{field} is {repr(value)[:100]}, but {rule}")


def check_choice(field: str, value: str, choices: Sequence[str]) -> None:
    """LfsrError unless ``value`` is one of ``choices``."""
    if value not in choices:
        raise LfsrError(f"{field} is {repr(value)[:100]}: {did_you_mean(str(value), choices)}It must be one of "
                        f"{', '.join(choices)}")


def check_within(field: str, value: float, least: float, most: float) -> None:
    """LfsrError unless ``value`` lies between ``least`` and ``most``, both included."""
    if not least <= value <= most:
        fail(field, value, f"it must be between {least:g} and {most:g}")


class _WrongError(Exception):
    """What is wrong with a value; ``places`` name it, the innermost first."""

    def __init__(self, rule: str, of_value: bool = False) -> None:
        """``of_value``: True if ``rule`` continues a sentence after the place ("is 3, but …"), False if it is one."""
        super().__init__(rule)
        self.places: list[str] = []
        self.of_value = of_value


def _value_error(value: Any, rule: str) -> _WrongError:
    return _WrongError(f"is {repr(value)[:MOST_VALUE]}, but it must be {rule}", of_value=True)


def _value(value: Any, kind: Any) -> Any:
    """Return ``value`` if it is of the type ``kind``, else raise _WrongError."""
    if kind is Any:
        return value
    if kind in PLAIN:
        allowed, rule = PLAIN[kind]
        fits = isinstance(value, allowed) and isinstance(value, bool) <= (kind is bool)
        if not fits or (kind is float and not abs(value) <= sys.float_info.max):
            raise _value_error(value, rule)
        if kind is str and (len(value) > MOST_TEXT or SURROGATE.search(value)):
            raise _value_error(value, f"UTF-8 text of at most {MOST_TEXT} characters")
        if kind in (int, float) and isinstance(value, int) and abs(value) >= MOST_WHOLE:  # arrays do not hold it
            raise _value_error(value, "a whole number below 2⁶³" if kind is int
                               else "a number below 2⁶³, or with a point")
        return value
    if dataclasses.is_dataclass(kind):
        record: Any = kind
        if not isinstance(value, dict):
            raise _value_error(value, "an object")
        fields = {_key(field): field for field in dataclasses.fields(kind) if field.init}
        for key in value:
            if key not in fields:
                raise _WrongError(f"unknown field {repr(key)[:MOST_VALUE]}; {did_you_mean(key, fields)}the fields are "
                                  f"{textwrap.shorten(', '.join(fields), MOST_VALUE, placeholder=' …')}")
        for key, field in fields.items():
            if key not in value and field.default is field.default_factory is dataclasses.MISSING:
                raise _WrongError(f"field {key!r} is missing; every {record.__name__} needs it")
        hints = _hints(record)
        return record(**{fields[key].name: _item(f".{key}", inner, hints[fields[key].name])
                       for key, inner in value.items()})
    origin = typing.get_origin(kind)
    kinds: tuple[Any, ...] = typing.get_args(kind)
    if origin is tuple:
        if not isinstance(value, (list, tuple)):
            raise _value_error(value, "a list")
        kinds = kinds[:1] * len(value) if kinds[-1] is Ellipsis else kinds
        if len(value) != len(kinds):
            raise _value_error(value, f"a list of {len(kinds)} entries")
        return tuple(_item(f"[{index}]", *pair) for index, pair in enumerate(zip(value, kinds, strict=True)))
    if origin is dict:
        if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
            raise _value_error(value, "an object")
        return {key: _item(f".{key}", inner, kinds[1]) for key, inner in value.items()}
    if origin is typing.Literal:
        if not any(value == choice and type(value) is type(choice) for choice in kinds):
            raise _value_error(value, f"one of {', '.join(map(str, kinds))}")
        return value
    [other] = [choice for choice in kinds if choice is not types.NoneType]  # None, or the one other type
    return None if value is None else _value(value, other)


def _key(field: dataclasses.Field[Any]) -> str:
    """Return the JSON key of a field: ``metadata["key"]``, else its name."""
    return str(field.metadata.get("key", field.name))


_hints = functools.cache(typing.get_type_hints)


def _item(place: str, value: Any, kind: Any) -> Any:
    """Return a value inside another; an error carries its ``place``."""
    try:
        return _value(value, kind)
    except _WrongError as error:
        error.places.append(place)
        raise
