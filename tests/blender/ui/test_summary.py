"""Numbers that the panel shows."""

from blender_addon.scene import folders
from blender_addon.ui import summary
from lfsr_core.frames.request import Finish, Report, write_report
from tests.support.synthetic import write_render


def write_metrics(folder, metrics: dict) -> None:
    write_report(folder, Report(Finish("bicubic"), "bicubic", "mini", 4, 16, {"render": 1.0}, None, 0.5,
                                metrics=metrics))


def test_metrics_of_this_files_frame_are_shown(scene):
    folder = folders.frame_folder(scene)
    assert summary.metric_facts(scene) == []
    folder.mkdir(parents=True)
    for flip, shown in ((0.01234, "0.0123"), (None, "not computed")):
        write_metrics(folder, {"ssim_eia_fg": 0.91234, "psnr_fg": 31.26, "flip": flip})
        assert summary.metric_facts(scene) == [("SSIM Foreground", "0.9123"), ("PSNR", "31.3 dB"), ("FLIP", shown)]
    write_render(folder, source="../other.blend")
    write_metrics(folder, {"psnr_fg": 31.26})
    assert summary.metric_facts(scene) == [], "it is another file's"
