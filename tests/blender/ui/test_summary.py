"""Numbers that the panel shows."""

import pytest

from blender_addon.scene import folders
from blender_addon.ui import summary
from lfsr_core.frames.finish import Finish, Report, write_report
from tests.support.synthetic import write_render


def write_metrics(folder, metrics: dict) -> None:
    write_report(folder, Report(Finish("bicubic"), "bicubic", "mini", 4, 16, {"render": 1.0}, None, 0.5,
                                metrics=metrics))


@pytest.mark.parametrize(("flip", "shown"), [(0.01234, "0.0123"), (None, "not computed")])
def test_metrics_of_the_frame_are_shown(scene, flip, shown):
    folder = folders.frame_folder(scene)
    folder.mkdir(parents=True)
    metrics = {"ssim_eia_fg": 0.91234, "psnr_fg": 31.26, "flip": flip}
    write_metrics(folder, metrics)
    assert summary.metric_facts(scene) == [("SSIM Foreground", "0.9123"), ("PSNR", "31.3 dB"), ("FLIP", shown)]


def test_metrics_of_another_files_frame_are_not_shown(scene):
    folders.frame_folder(scene).mkdir(parents=True)
    folder = folders.frame_folder(scene)
    write_render(folder, source="../other.blend")
    write_metrics(folder, {"psnr_fg": 31.26})
    assert summary.metric_facts(scene) == []


def test_without_a_frame_there_are_no_metrics(scene):
    assert summary.metric_facts(scene) == []
