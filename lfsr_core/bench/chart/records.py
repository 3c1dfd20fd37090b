"""What chart.json holds, checked without a package for schemas."""

from __future__ import annotations

import math
from typing import Any

from lfsr_core.bench.chart.analysis import CEILING, DIRECT, LOW, METRICS
from lfsr_core.errors import LfsrError
from lfsr_core.metrics.eia_metrics import METRIC_NAMES

FORMAT = 1
TEXT, WHOLE, NUMBER, FLAG = "text", "whole number", "number", "true or false"
TYPES = {TEXT: (str,), WHOLE: (int,), NUMBER: (int, float), FLAG: (bool,)}


class Optional(tuple):
    """``Optional((spec,))``: null or what ``spec`` says."""


class Each(tuple):
    """``Each((spec,))``: an object of any keys whose values are as ``spec`` says."""


class OneOf(tuple):
    """``OneOf((a, b))``: one of these texts."""


def optional(spec: Any) -> Optional:
    """Null or what ``spec`` says."""
    return Optional((spec,))


ROLE = OneOf((LOW, DIRECT, CEILING))
POINT = {"role": ROLE, "method": TEXT, "samples": WHOLE, "seconds": NUMBER, "value": NUMBER}
DUEL = POINT | {"needs_seconds": optional(NUMBER), "bound": FLAG, "ratio": optional(NUMBER),
                "outcome": OneOf(("win", "loss"))}
GOAL = optional({"from_value": NUMBER, "to_value": NUMBER, "worst_ratio": optional(NUMBER), "met": FLAG,
                 "stretch_met": FLAG})
CELL = {"role": ROLE, "method": TEXT, "scale": WHOLE, "samples": WHOLE, "render_seconds": [NUMBER],
        "open_seconds": NUMBER, "second_stage_seconds": [NUMBER], "stage_seconds": Each((NUMBER,)),
        "seconds": {"median": NUMBER, "least": NUMBER, "most": NUMBER},
        "metrics": {name: optional(NUMBER) for name in (*METRIC_NAMES, "recall")},
        "ci95": Each((optional(NUMBER),)), "notes": [TEXT], "load_average": optional(NUMBER), "device": TEXT}
ANALYSIS = {"metric": OneOf(METRICS), "ceiling": optional({"method": TEXT, "samples": WHOLE, "value": NUMBER}),
            "front": [POINT], "target": GOAL, "target_with_opening": GOAL, "targets_of_others": Each((GOAL,)),
            "versus": [DUEL], "reverse": [DUEL]}
SCHEMA: dict[str, Any] = {
    "format": WHOLE,
    "settings": {"display": TEXT, "scale": WHOLE, "spps": [WHOLE], "direct_spps": [WHOLE], "methods": [TEXT],
                 "direct_methods": [TEXT], "ours": TEXT, "reference_spp": WHOLE, "lenses": optional(WHOLE),
                 "ceiling_spp": WHOLE, "repeats": WHOLE, "render_repeats": WHOLE},
    "environment": {"cpu": TEXT, "cores": WHOLE, "memory_gib": optional(NUMBER), "system": TEXT, "python": TEXT,
                    "gpu": optional(TEXT), "versions": Each((TEXT,))},
    "methods": [{"method": TEXT, "parameters": optional(WHOLE), "multiply_adds_per_low_pixel": optional(NUMBER),
                 "fresh_process_seconds": optional(NUMBER)}],
    "skipped": [TEXT],
    "scenes": [{"scene": TEXT, "blender": TEXT, "p": NUMBER,
                "reference": {"samples": WHOLE, "lenses": optional(WHOLE), "seconds": NUMBER},
                "cells": [CELL], "analysis": [ANALYSIS]}],
}


def check_chart(data: Any) -> None:
    """LfsrError naming the first place where ``data`` is not a chart of this format."""
    if isinstance(data, dict) and data.get("format") != FORMAT:
        raise LfsrError(f"chart has format {data.get('format')!r}, but this version reads {FORMAT}: measure it again")
    _check(data, SCHEMA, "chart")


def _check(data: Any, spec: Any, place: str) -> None:
    if isinstance(spec, Optional):
        if data is not None:
            _check(data, spec[0], place)
    elif isinstance(spec, OneOf):
        if data not in spec:
            raise _wrong(place, data, f"one of {', '.join(spec)}")
    elif isinstance(spec, str):
        _check_leaf(data, spec, place)
    elif isinstance(spec, list):
        _check_items(data, spec[0], place)
    else:
        _check_object(data, spec, place)


def _check_leaf(data: Any, spec: str, place: str) -> None:
    fits = isinstance(data, TYPES[spec]) and isinstance(data, bool) <= (spec == FLAG)
    if not fits or (isinstance(data, float) and not math.isfinite(data)):
        raise _wrong(place, data, spec)


def _check_items(data: Any, spec: Any, place: str) -> None:
    if not isinstance(data, list):
        raise _wrong(place, data, "a list")
    for index, item in enumerate(data):
        _check(item, spec, f"{place}[{index}]")


def _check_object(data: Any, spec: Any, place: str) -> None:
    if not isinstance(data, dict):
        raise _wrong(place, data, "an object")
    if isinstance(spec, Each):
        spec = dict.fromkeys(data, spec[0])
    for key in (*spec, *data):
        if key not in data or key not in spec:
            raise LfsrError(f"{place} {'lacks' if key not in data else 'has an unknown entry'} {key!r}: "
                            "measure the chart again with this version")
        _check(data[key], spec[key], f"{place}.{key}")


def _wrong(place: str, data: Any, expected: str) -> LfsrError:
    return LfsrError(f"{place} is {str(data)[:60]!r}, but it must be {expected}: measure the chart again")
