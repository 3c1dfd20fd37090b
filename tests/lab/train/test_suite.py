"""Every comparator at once."""

from __future__ import annotations

import pytest

from lfsr_lab.train import suite
from tests.support.training_photographs import write_pictures


@pytest.mark.slow
def test_suite_trains_the_chosen_runs_in_processes(tmp_path, capsys):
    folder = write_pictures(tmp_path / "photographs")
    command = ["--cache", str(folder), "--validation", str(folder), "--output", str(tmp_path), "--device", "cpu",
               "--jobs", "2", "--threads", "1", "--only", "paper-x2,espcn-x2", "--set", "epochs=1", "--set", "crop=16",
               "--set", "crops_per_photograph=2"]
    assert suite.main(command) == 0
    assert {"paper-x2.safetensors", "paper-x2.json", "espcn-x2.safetensors", "suite.json", "paper-x2.log.jsonl"} <= {
        path.name for path in tmp_path.iterdir()}
    assert suite.main([*command, "--set", "crop=15", "--output", str(tmp_path / "bad")]) == 1
    assert "no multiple of scale" in capsys.readouterr().out
    assert suite.main([*command, "--only", "nothing"]) == 2
