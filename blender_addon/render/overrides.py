"""Borrowed settings: set for one render, back as they were afterwards."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any


@contextmanager
def overridden(owner: Any, values: Mapping[str, Any]) -> Iterator[None]:
    """Set properties of ``owner`` inside the block and restore them after it, in the order given.

    Whatever ends the block, also an error or a cancel, restores them. List a
    property after those it depends on (a bit depth after its file format): all are
    recorded before the first is set, so the same order is right both ways. Names
    that this Blender does not have raise AttributeError: versions differ in compat.py only.
    """
    before = {name: _copy(getattr(owner, name)) for name in values}
    try:
        _set(owner, values)
        yield
    finally:
        _set(owner, before)


def _set(owner: Any, values: Mapping[str, Any]) -> None:
    for name, value in values.items():
        # Setting an equal value would still tag the data for an update.
        if _copy(getattr(owner, name)) != value:
            setattr(owner, name, value)


def _copy(value: Any) -> Any:
    """Plain copy of an array property, which is otherwise a window on the live data."""
    if hasattr(value, "__len__") and not isinstance(value, (str, set)):
        return tuple(value)
    return value
