"""A few of the random sheets: what is accepted is right, what must be refused is refused."""

from __future__ import annotations

import pytest

from lfsr_core.base.files import write_json
from lfsr_lab.experiments.photographs.study import PITCH, TILT, measured, tables


@pytest.mark.slow
def test_accepted_photographs_are_right_and_bad_ones_refused(tmp_path):
    found = {f"sheet-{number:03}": measured(tmp_path, number, 1) for number in (0, 11, 12)}
    found |= {f"bad-{bad.replace(' ', '-')}-0": measured(tmp_path, 0, 1, bad) for bad in ("grey", "covered", "cut off")}
    accepted = [one["wrong"] for one in found.values() if "wrong" in one]
    assert len(accepted) >= 2 and all(abs(pitch) < PITCH and abs(tilt) < TILT for pitch, tilt, _ in accepted)
    assert all("refused" in one for name, one in found.items() if name.startswith("bad"))
    for name, one in found.items():
        write_json(tmp_path / f"{name}.json", one)
    shown = tables(tmp_path)
    assert f"| all | {len(accepted)} of 3 |" in shown and "| grey | 0 of 1 |" in shown
