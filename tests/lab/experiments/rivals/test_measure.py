"""Figures on renders: a network that interpolates linearly is as good as linear interpolation, in the same lenses."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

from lfsr_core.metrics.intervals import student_95
from lfsr_core.reconstruct.methods import denoise
from lfsr_lab.experiments.engine.renders import Store
from lfsr_lab.experiments.engine.truth import Truth
from lfsr_lab.experiments.rivals.measure import NARROW, SCENES, Figures, Row, View, folder_of, job, measure, place
from lfsr_lab.experiments.rivals.study import markdown, record, rendered_scenes
from tests.support import stored_weights as stored
from tests.support.synthetic import MINI, write_reference, write_render

NINE = dataclasses.replace(MINI, name="nine", panel_pixels=(144, 108), views=(9, 9))


@pytest.mark.skipif(not denoise.is_available(), reason="needs Open Image Denoise")
def test_a_linear_network_is_linear_interpolation(tmp_path):
    stored.tent(tmp_path)
    truth = Truth(write_reference(tmp_path / "reference", display=NINE))
    row = measure(write_render(tmp_path / "render", 3, NINE), truth, "oidn", tmp_path)
    assert list(row.followers) == ["bilinear", "bicubic", "pool", "EPICNN"]
    linear, network = row.followers["bilinear"], row.followers["EPICNN"]
    assert len(linear.ssim) == len(truth.lenses) == len(network.squared)
    np.testing.assert_allclose(network.ssim, linear.ssim, atol=0.05)
    assert network.psnr == pytest.approx(linear.psnr, abs=1)


def test_renders_of_both_widths_have_folders_of_their_own(tmp_path):
    (tmp_path / "cloth.blend").touch()
    where = place("cloth", Store(tmp_path / "out"), [tmp_path / "empty", tmp_path])
    wide, narrow = (job(where, view) for view in (View(7, 16), View(7, 16, NARROW)))
    assert (wide.view_aperture, narrow.view_aperture) == (7, 1)
    assert wide.output != narrow.output and narrow.output.endswith(folder_of(View(7, 16, NARROW)))
    assert wide.display.low_views(7) == (6, 6) and wide.display.low_views(3) == (14, 14)
    assert rendered_scenes([tmp_path], tmp_path, Store(tmp_path / "out", may_render=False)) == {}


def test_a_page_is_made_of_means_and_differences_in_pairs():
    def row(*ssim):
        return Row(2.0, {name: Figures(tuple(value + shift for value in ssim), (0.01, 0.01), 1.0)
                         for name, shift in [("bilinear", -0.1), ("pool", 0.0)]})

    rows = {(scene, View(scale, samples, width), "denoise"): row(0.8, 0.9) for scene in list(SCENES)[:2]
            for scale in (7, 3) for samples in (4, 16) for width in ("wide", "narrow")}
    rows["helmet", View(7, 16), "oidn"] = row(0.7, 0.9)
    found = record(rows, {})
    entry = found["scenes"]["helmet"]["s7-spp16-wide"]
    assert entry["denoise+bilinear"] == [0.75, 20.0, 3.0, -0.1, 0.0]
    assert entry["oidn+pool"][3:] == [-0.05, pytest.approx(0.05 * student_95(1), abs=1e-3)]
    page = markdown(found)
    assert "| `denoise+pool` | .850, 20.0 |" in page and not re.search(r"\bnan\b", page)
