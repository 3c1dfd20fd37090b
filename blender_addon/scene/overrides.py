"""Change settings or add data for one render, and undo that afterwards."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import bpy


@contextmanager
def overridden(owner: Any, values: Mapping[str, Any]) -> Iterator[None]:
    """Set properties of ``owner`` inside the block and restore them after it, also after an error.

    List a property after those it depends on (a bit depth after its file format): all are recorded before
    the first is set, and they are set and restored in the given order. AttributeError for a name that this
    Blender does not have: only compat.py knows the differences between versions.
    """
    before = {name: _copy(getattr(owner, name)) for name in values}
    try:
        _set(owner, values)
        yield
    finally:
        _set(owner, before)


@contextmanager
def new_data() -> Iterator[list[bpy.types.ID]]:
    """Yield a list of new data, which is removed from the file after the block."""
    made: list[bpy.types.ID] = []
    try:
        yield made
    finally:
        bpy.data.batch_remove(made)


def _set(owner: Any, values: Mapping[str, Any]) -> None:
    for name, value in values.items():
        # Setting an equal value would tag the data for an update.
        if _copy(getattr(owner, name)) != value:
            setattr(owner, name, value)


def _copy(value: Any) -> Any:
    """Copy of an array property, which would change with the data."""
    if hasattr(value, "__len__") and not isinstance(value, (str, set)):
        return tuple(value)
    return value
