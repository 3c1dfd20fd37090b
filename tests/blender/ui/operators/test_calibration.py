"""The buttons that write the test picture and calibrate a display by photographs of it."""

import dataclasses

import bpy
import numpy as np
import pytest

from lfsr_core.calibration.patterns import pattern
from lfsr_core.images.png import read_png
from lfsr_core.optics.display import load_display, write_profile
from tests.calibration.test_fit import CYLINDERS, GOOD, PLACE
from tests.support import panel
from tests.support.telephone import jpeg


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    with panel.registered():
        folder = tmp_path_factory.mktemp("calibration")
        write_profile(folder / "own.toml", CYLINDERS)
        made = panel.artist_scene(folder)
        made.lfsr.display, made.lfsr.profile_file = "FILE", str(folder / "own.toml")
        yield made, folder


def test_the_test_picture_is_photographed_and_the_display_calibrated(scene):
    made, folder = scene
    assert bpy.ops.lfsr.test_picture(filepath=str(folder / "phase.png")) == {"FINISHED"}
    np.testing.assert_array_equal(read_png(folder / "phase.png"), pattern(CYLINDERS, "phase"))
    shot = dataclasses.replace(GOOD, rays=1)
    (folder / "photo.jpg").write_bytes(jpeg(read_png(folder / "phase.png"), CYLINDERS, shot))
    with pytest.raises(RuntimeError, match="by its perspective"):
        bpy.ops.lfsr.calibrate(files=[{"name": "photo.jpg"}], directory=str(folder), place=(-200.0, 0.0, 500.0))
    assert made.lfsr.profile_file.endswith("own.toml")
    assert bpy.ops.lfsr.calibrate(files=[{"name": "photo.jpg"}], directory=str(folder), place=PLACE) == {"FINISHED"}
    assert made.lfsr.profile_file.endswith("large-calibrated.toml")
    assert load_display(made.lfsr.profile_file).lenticular.pitch_mm == pytest.approx(1.6, rel=2e-5)
    assert (folder / "large-calibrated.png").exists()


def test_no_photograph_is_named(scene):
    panel.refused("No photograph was chosen", bpy.ops.lfsr.calibrate, directory=str(scene[1]))
