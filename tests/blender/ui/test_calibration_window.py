"""Calibration by a photograph in a real window: the profile is chosen, and what it predicts is shown."""

import numpy as np
import pytest

from lfsr_core.calibration.patterns import pattern
from lfsr_core.images.image_files import read_png
from lfsr_core.optics.display import write_profile
from tests.calibration.test_fit import CYLINDERS, GOOD, PLACE
from tests.support.telephone import jpeg
from tests.support.window.desktop import NEEDS_WINDOW, blender_window

pytestmark = NEEDS_WINDOW


@pytest.fixture(scope="module")
def window(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gui")
    write_profile(folder / "own.toml", CYLINDERS)
    (folder / "photo.jpg").write_bytes(jpeg(pattern(CYLINDERS, "phase"), CYLINDERS, GOOD))
    with blender_window(folder) as window:
        window.run(f"lfsr = bpy.context.scene.lfsr; lfsr.display = 'FILE'; "
                   f"lfsr.profile_file = {str(folder / 'own.toml')!r}")
        yield window, folder


def test_a_photograph_calibrates_the_display_and_the_prediction_is_shown(window):
    window, folder = window
    window.open_tab()
    before = read_png(window.screenshot("calibration-1-before"))
    window.run(f"bpy.ops.lfsr.calibrate(files=[{{'name': 'photo.jpg'}}], directory={str(folder)!r}, place={PLACE})")
    after = read_png(window.screenshot("calibration-2-after"))
    assert (folder / "large-calibrated.toml").exists()
    assert before.shape == after.shape and np.mean(before != after) > 0.05, "the prediction's window"
