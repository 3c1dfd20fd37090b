"""What figures were measured with."""

from __future__ import annotations

import dataclasses
import platform
import sys

import numpy as np

import lfsr_core
from lfsr_core.base.records import from_data, to_data
from lfsr_lab.experiments.engine.report import Environment, environment
from tests.support.synthetic import fails


def test_this_machine_is_described_and_read_back():
    found = environment()
    assert found.python == platform.python_version() and found.cores >= 1 and found.cpu
    assert found.versions["lfsr"] == lfsr_core.__version__ and found.versions["numpy"] == np.__version__
    assert from_data(Environment, to_data(found), "the environment") == found


def test_a_graphics_card_is_named_beside_the_processor():
    found = dataclasses.replace(environment(), cpu="Example", cores=2, gpu=None)
    assert found.machine == "2 cores of Example"
    assert dataclasses.replace(found, gpu="Card").machine == "2 cores of Example and Card"


def test_a_chart_is_refused_before_it_is_measured_where_it_could_not_be_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "jinja2", None)
    for words in (["study", "chart", "vase.blend"], ["study", "stress"]):
        message = fails([*words, "-o", str(tmp_path / "out")], capsys)
        assert "'Jinja2', which is not installed: install lfsr-lab" in message
    assert not (tmp_path / "out").exists()
