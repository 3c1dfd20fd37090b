"""docs/reference/frame-folder.md says what the JSON files hold: no key more, none less, of the types it names."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from lfsr_core.frames.finish import Finish
from lfsr_core.metrics.compare import compare_folders
from lfsr_core.pipeline.make import finish_frame
from tests.support.synthetic import write_reference, write_render

DOCUMENT = Path(__file__).parents[2] / "docs" / "reference" / "frame-folder.md"
TYPES = {"text": str, "integer": int, "number": (int, float), "boolean": bool, "array": list, "object": dict,
         "null": type(None)}
STAGES = {"render", "load", "mask", "upscale", "assemble", "color", "write"}


def documented(section: str, reference: str = "any") -> dict[str, tuple[str, ...]]:
    """Key -> names of allowed types, from the table of one section; ``reference``: which metrics, whole or list."""
    text = DOCUMENT.read_text(encoding="utf-8").split(f"\n## {section}\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)` \| ([\w ]+) \| (?:(any|whole|list) \|)?", text, re.M)
    return {key: tuple(types.split(" or ")) for key, types, kind in rows if kind in ("", "any", reference)}


def check(data: dict[str, Any], section: str, reference: str = "any") -> None:
    table = documented(section, reference)
    assert set(data) - {"lenses", "ci95"} == set(table)
    for key, types in table.items():
        assert any(isinstance(data[key], TYPES[name]) for name in types), (key, data[key])
        assert isinstance(data[key], bool) <= ("boolean" in types), key


def read(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = write_render(tmp_path_factory.mktemp("frame"))
    finish_frame(folder, Finish("bicubic", dilate=1))
    return folder


def test_frame(folder):
    check(read(folder / "frame.json"), "frame.json")


def test_report(folder):
    report = read(folder / "report.json")
    check(report, "report.json")
    assert set(report["seconds"]) == STAGES
    assert all(value >= 0 for value in report["seconds"].values())
    assert 0 < report["foreground_fraction"] < 1
    assert report["finish"]["dilate"] == 1


def test_metrics(folder, tmp_path):
    compare_folders(folder, write_reference(tmp_path))
    metrics = read(folder / "report.json")["metrics"]
    check(metrics, "metrics", "whole")
    assert "lenses" not in metrics


def test_metrics_of_sampled_lenses(folder, tmp_path):
    compare_folders(folder, write_reference(tmp_path, lens_list=((3, 5), (4, 6), (5, 7), (0, 0), (1, 1))))
    metrics = read(folder / "report.json")["metrics"]
    check(metrics, "metrics", "list")
    assert metrics["lenses"] == 5
    assert set(metrics["ci95"]) <= set(documented("metrics", "list"))
