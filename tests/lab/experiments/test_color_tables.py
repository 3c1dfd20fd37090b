"""The sweep over colour chains: all that Blender offers, and what it says of one."""

from __future__ import annotations

import numpy as np

from lfsr_core.images.color_settings import ColorSettings
from lfsr_lab.experiments import color_tables
from lfsr_lab.experiments.color_tables import Row, chains, measure, random_colors
from tests.support.prerequisites import needs_bpy

pytestmark = needs_bpy  # for Blender's colour configuration


def test_every_chain_comes_once_with_the_looks_of_its_view():
    found = list(chains())
    assert len(set(found)) == len(found) > 100
    agx = {chain.look for chain in chains(["sRGB"], ["AgX"])}
    assert {"None", "AgX - Punchy"} < agx and not {"High Contrast", "Filmic - High Contrast"} & agx


def test_a_table_is_held_against_the_chain_itself(capsys, monkeypatch):
    found = measure(ColorSettings(view_transform="AgX", look="AgX - Punchy"), random_colors(4096))
    assert found.is_baked and found.kept and 0 < found.worst <= 3
    assert not Row(found.settings, True, 4, 1.0).kept and not Row(found.settings, True, 2, 0.998).kept
    monkeypatch.setattr(color_tables, "chains", lambda *_: [ColorSettings()])
    assert color_tables.main(["--colors", "64"]) == 0
    assert "| sRGB | Standard | None | exact | 0 | 100.0000% | yes |" in capsys.readouterr().out
    monkeypatch.setattr(color_tables, "measure", lambda settings, _: Row(settings, True, 4, 1.0))
    assert color_tables.main(["--colors", "64"]) == 1, "a chain that breaks the promise"


def test_colors_hold_greys_and_pure_lights():
    colors = random_colors(4000)[0]
    assert (colors[:1000] == colors[:1000, :1]).all() and ((colors[1000:2000] == 0).sum(1) == 1).all()
    assert colors.min() >= 0 and np.isfinite(colors).all()
