"""What figures were measured with."""

from __future__ import annotations

import dataclasses
import platform

import numpy as np

import lfsr_core
from lfsr_core.bench.environment import Environment, environment
from lfsr_core.records import from_data, to_data


def test_this_machine_is_described_and_read_back():
    found = environment()
    assert found.python == platform.python_version() and found.cores >= 1 and found.cpu
    assert found.versions["lfsr"] == lfsr_core.__version__ and found.versions["numpy"] == np.__version__
    assert from_data(Environment, to_data(found), "the environment") == found


def test_a_graphics_card_is_named_beside_the_processor():
    found = dataclasses.replace(environment(), cpu="Example", cores=2, gpu=None)
    assert found.machine == "2 cores of Example"
    assert dataclasses.replace(found, gpu="Card").machine == "2 cores of Example and Card"
