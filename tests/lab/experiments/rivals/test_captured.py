"""Views that are left out of light fields and made again: their order, and which of them count."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from lfsr_core.base.errors import LfsrError
from lfsr_core.cli import main
from lfsr_lab.experiments.rivals.captured import FOLDERS, TASKS, likeness, made, methods, read_field
from tests.support import stored_weights as stored

SIZE = (50, 54)


def ramp(rows, columns):
    """Views that grow brighter downwards by 6 and rightwards by 2 of 255."""
    values = 60 + 6 * np.arange(rows)[:, None] + 2 * np.arange(columns)
    return np.broadcast_to(values[:, :, None, None, None], (rows, columns, *SIZE, 3)).astype(np.uint8)


@pytest.fixture
def clones(tmp_path):
    for field, views, pattern in [("antinous", ramp(9, 9), "input_Cam{number:03d}.png"),
                                  ("translucent", ramp(7, 7), "translucent_{row:02d}_{column:02d}.png"),
                                  ("Amethyst", ramp(1, 17), "out_00_{column:02d}_-399.5_{number}.25_.png")]:
        folder = tmp_path / FOLDERS[field]
        folder.mkdir(parents=True)
        for row, column in np.ndindex(views.shape[:2]):
            number = row * views.shape[1] + column
            Image.fromarray(views[row, column]).save(folder / pattern.format(row=row, column=column, number=number))
    return tmp_path


@pytest.mark.parametrize("task", [task for task in TASKS if task.field != "t_rex"], ids=lambda task: task.name)
def test_views_between_come_back_in_their_places(clones, task):
    views = read_field(clones, task)
    stored.tent(clones)
    assert views.shape[1] == task.made and views.shape[0] in (1, task.made)
    for name in set(methods(task, views)) & {"bilinear", "bicubic", "EPICNN"}:
        shown = made(views, task, name, clones).astype(float)
        # The kernels of ours and cubic ones in the networks round the corners of a ramp that ends.
        tolerance = 3 if "bicubic" in name else 1.01
        assert np.abs(shown - views)[..., 10:-10, 10:-10, :].max() <= tolerance, name
    assert ("Sheared-EPI" in methods(task, views)) == (task.shear > 0)


def test_only_views_that_were_left_out_count(clones):
    views = np.random.default_rng(0).integers(0, 200, (4, 4, *SIZE, 3)).astype(np.uint8)
    shown = views.copy()
    shown[::3, ::3] = 0
    assert likeness(shown, views, 3).psnr == 100 and likeness(shown, views, 3).ssim == pytest.approx(1)
    shown = views + np.uint8(51)  # luma has 219 steps for 255
    assert likeness(shown, views, 3).psnr == pytest.approx(-20 * np.log10(0.2 * 219 / 255), abs=0.01)
    shown[:, :, :22] = shown[:, :, -22:] = 0
    assert likeness(shown, views, 3).psnr == pytest.approx(-20 * np.log10(0.2 * 219 / 255), abs=0.01)


def test_a_field_that_is_not_whole(clones, tmp_path, capsys):
    for path in (clones / FOLDERS["Amethyst"]).glob("out_00_16_*"):
        path.unlink()
    for path in (clones / FOLDERS["Amethyst"]).glob("out_00_15_*"):
        path.unlink()
    with pytest.raises(LfsrError, match="has 15 views across, expected 16: fetch the whole folder"):
        read_field(clones, next(task for task in TASKS if task.field == "Amethyst"))
    assert main(["study", "rivals", str(tmp_path / "none"), "-o", str(tmp_path / "out")]) == 2
    assert "is no folder" in capsys.readouterr().err
