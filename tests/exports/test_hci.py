"""The HCI export, by the rules of the benchmark's own toolkit."""

import configparser
import dataclasses
import math
import re

import cv2
import numpy as np
import pytest

from lfsr_core.base.notices import Notice
from lfsr_core.exports.formats import export
from lfsr_core.exports.light_field import central_disparity, read_light_field
from lfsr_core.exports.options import ExportOptions
from lfsr_core.frames.frame import read_frame, write_frame
from tests.support.finished import MINI, TALL, finished, picture
from tests.support.told import Told, refuses


def pfm(path) -> np.ndarray:
    """As the evaluation toolkit's read_pfm does."""
    with path.open("rb") as file:
        assert file.readline() == b"Pf\n"
        width, height = map(int, file.readline().split())
        scale = float(file.readline())
        return np.flipud(np.fromfile(file, "<f4" if scale < 0 else ">f4").reshape(height, width)) * abs(scale)


@pytest.fixture(scope="module")
def hci(folder, tmp_path_factory):
    target = tmp_path_factory.mktemp("hci")
    export(folder, "hci", target, ExportOptions(views=(7, 7)))
    parameters = configparser.ConfigParser()
    parameters.read(target / "parameters.cfg")
    views = [picture(target / f"input_Cam{number:03d}.png") for number in range(49)]
    return np.array(views).reshape(7, 7, 12, 16, 3), parameters, pfm(target / "gt_disp_lowres.pfm")


def test_hci_has_its_views_and_parameters(hci, field):
    views, parameters, _ = hci
    np.testing.assert_array_equal(views, field.resampled((7, 7)))
    inside, outside = parameters["intrinsics"], parameters["extrinsics"]
    assert (inside["image_resolution_x_px"], inside["image_resolution_y_px"]) == ("16", "12")
    assert (outside["num_cams_x"], outside["num_cams_y"]) == ("7", "7")
    focal, sensor, baseline, focus = (float(section[name]) for section, name in (
        (inside, "focal_length_mm"), (inside, "sensor_size_mm"), (outside, "baseline_mm"),
        (outside, "focus_distance_m")))
    assert baseline == pytest.approx(MINI.camera_spacing_mm * 8 / 7)
    assert focus * 1000 == pytest.approx(MINI.viewing_distance_mm)
    assert focus * 1000 * sensor / focal == pytest.approx(MINI.panel_mm[0])
    assert float(outside["offset"]) == pytest.approx(baseline * focal / focus / 1000 / sensor * 16)
    assert float(outside["center_cam_ry_rad"]) == pytest.approx(math.asin(0.6))


def test_hci_disparity_becomes_the_depth_that_is_there(hci):
    """By the toolkit's conversion: depth = b·f·res·focus / (disparity·focus·sensor + b·f·res)."""
    _, parameters, disparity = hci
    value = {name: float(text) for section in ("intrinsics", "extrinsics", "meta")
             for name, text in parameters[section].items() if re.fullmatch(r"-?[\d.e-]+", text)}
    b = value["baseline_mm"] * value["focal_length_mm"] * 16
    focus = value["focus_distance_m"] * 1000
    depth = b * focus / (disparity * focus * value["sensor_size_mm"] + b) / MINI.viewing_distance_mm
    assert depth[4, 6] == pytest.approx(0.8, abs=1e-3) and depth[10, 14] == pytest.approx(1.25, abs=1e-3)
    assert disparity[4, 6] > 0 > disparity[10, 14], "positive in front of the display"
    assert value["disp_max"] == pytest.approx(disparity.max(), rel=1e-6)
    assert value["disp_min"] == pytest.approx(disparity.min(), rel=1e-6)


@pytest.fixture(scope="module")
def fine_hci(tmp_path_factory):
    """Views of 64×48 pixels, in which textures are many pixels wide, and their disparity."""
    target = tmp_path_factory.mktemp("fine")
    fine = dataclasses.replace(MINI, name="fine", lenses=(64, 48), panel_pixels=(512, 384))
    export(finished(target / "frame", fine), "hci", target / "hci", ExportOptions(views=(7, 7)))
    views = [picture(target / "hci" / f"input_Cam{number:03d}.png") for number in range(49)]
    return np.array(views).reshape(7, 7, 48, 64, 3), pfm(target / "hci" / "gt_disp_lowres.pfm")


@pytest.mark.parametrize(("row", "column"), [(3, 5), (3, 1), (5, 3), (1, 3), (2, 2)])
def test_hci_disparity_warps_views_onto_each_other(fine_hci, row, column):
    """A camera ``n`` steps to the right sees a point ``n`` disparities further left; likewise down and up."""
    views, disparity = fine_hci
    rows, columns = np.indices(disparity.shape, np.float32)
    inside = np.s_[6:-6, 6:-6]

    def error(sign):
        warped = cv2.remap(views[row, column], (columns - sign * (column - 3) * disparity).astype(np.float32),
                           (rows - sign * (row - 3) * disparity).astype(np.float32), cv2.INTER_LINEAR)
        return np.abs(warped[inside].astype(float) - views[3, 3][inside]).mean()

    assert error(1) < 0.6 * error(0) < 0.6 * error(-1)


def test_disparity_of_one_row_of_views_lies_where_things_are(tmp_path):
    row = dataclasses.replace(MINI, name="row", views=(8, 1), lenses=(64, 48), panel_pixels=(512, 48))
    field = read_light_field(finished(tmp_path / "frame", row, scale=4))
    near = field.view_at(3.5, 0)[..., 2] > 160  # the near square is the only blue
    wrong = ((central_disparity(field) > 0) != near).any(axis=1)
    assert set(np.nonzero(wrong)[0]) <= set(np.nonzero(near.any(axis=1))[0]), "above and below nothing is near"
    assert (central_disparity(field)[:, 28] > 0).tolist() == near[:, 28].tolist()


def test_hci_without_a_position_layer_says_so(tmp_path):
    folder = finished(tmp_path / "frame")
    frame = read_frame(folder)
    write_frame(folder, dataclasses.replace(frame, layers=()))
    told = Told()
    files = export(folder, "hci", tmp_path / "out", ExportOptions(views=(2, 2), tell=told))
    assert [path.name for path in files] == [f"input_Cam00{i}.png" for i in range(4)] + ["parameters.cfg"]
    assert Notice("disparity-missing") in told.notices


def test_hci_of_lenses_that_are_not_square(tmp_path):
    refuses("same proportion", export, finished(tmp_path / "frame", TALL), "hci", options=ExportOptions(views=(4, 4)))
    files = export(tmp_path / "frame", "hci", options=ExportOptions(views=(2, 3)))
    disparity = pfm(tmp_path / "frame" / "export" / "hci" / "gt_disp_lowres.pfm")
    assert len(files) == 8 and disparity.shape == (12, 16)
    spacing, pitch = TALL.camera_spacing_mm * 4, TALL.lens_pitch_mm[0]
    assert disparity[4, 6] == pytest.approx((1 / 0.8 - 1) * spacing / pitch, rel=1e-3)
