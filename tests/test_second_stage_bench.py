"""The speed benchmark: complete figures, and no variant that leaves pixels unwritten."""

from __future__ import annotations

import json

import pytest
import torch

from lfsr_core.bench import limits, second_stage
from lfsr_core.bench.layers import layer_bounds
from lfsr_core.errors import LfsrError
from lfsr_core.networks.espcn import ESPCN

CEILING = {"bytes_per_second": 1e9, "multiply_adds_per_second_float32": 1e10}


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setitem(second_stage.WORKLOADS, "tiny", second_stage.Workload((4, 5), 6))
    monkeypatch.setattr(limits, "measure", lambda device: CEILING)


def test_report_is_complete(tiny, tmp_path, capsys):
    path = tmp_path / "out.json"
    assert second_stage.main(["--methods", "paper,espcn", "--workloads", "tiny", "--repeats", "2",
                              "--json", str(path)]) == 0
    report = json.loads(path.read_text())
    assert [row["network"] for row in report["results"]] == ["paper", "espcn"]
    for row in report["results"]:
        assert row["ms"] == min(variant["ms"] for variant in row["variants"])
        assert row["worst_error_8_bit"] <= 1 and row["frames_per_second"] == pytest.approx(1e3 / row["ms"])
        # 20 EIs of 6×6: 3 floats in, 16·3 bytes out, the weights once.
        assert row["bytes_compulsory"] == 20 * 36 * (12 + 48) + 4 * row["parameters"]
    assert "paper" in capsys.readouterr().out


def test_unwritten_pixels_fail_the_benchmark(tiny, tmp_path, monkeypatch):
    monkeypatch.setattr(second_stage, "write_bytes", lambda *_: None)
    with pytest.raises(LfsrError, match="benchmark variant"):
        second_stage.main(["--methods", "paper", "--workloads", "tiny", "--repeats", "2",
                           "--json", str(tmp_path / "out.json")])


def test_layer_bounds_add_up():
    rows = layer_bounds(ESPCN(4), 10, 6, CEILING)
    assert sum(row["multiply_adds"] for row in rows) == 10 * 36 * (75 * 64 + 9 * 64 * 32 + 9 * 32 * 48)
    assert rows[0]["bytes"] == 10 * 36 * 4 * (3 + 64)
    assert rows[0]["ms_bound_memory"] == pytest.approx(1e3 * rows[0]["bytes"] / 1e9)


def test_timing_calls_and_statistics():
    calls = []
    seconds = limits.timed(lambda: calls.append("run"), torch.device("cpu"), 3, lambda: calls.append("before"), 2)
    assert len(seconds) == 3 and calls == ["run"] * 2 + ["before", "run"] * 3
    figures = limits.summary([0.001, 0.002, 0.010])
    assert figures["ms"] == pytest.approx(2) and figures["frames_per_second"] == pytest.approx(500)
