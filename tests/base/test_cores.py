"""The cores that a process may use."""

import os

import pytest

from lfsr_core.base.cores import CORES, usable_cores


@pytest.mark.parametrize(("text", "expected"), [
    ("1", 1), ("0", 1), ("100000", os.cpu_count()), ("", os.cpu_count()), ("many", os.cpu_count())])
def test_the_environment_may_ask_for_fewer_cores(monkeypatch, text, expected):
    monkeypatch.setenv(CORES, text)
    assert usable_cores() == expected
