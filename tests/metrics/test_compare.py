"""Comparing folders: recall of the foreground mask, and frames that change meanwhile."""

import numpy as np
import pytest

from lfsr_core.base.files import read_json
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.frame import MASK_FILE, REPORT_FILE
from lfsr_core.images.exr import write_layers
from lfsr_core.images.png import read_mask, write_mask
from lfsr_core.metrics import compare as compare_module
from lfsr_core.metrics.compare import compare_folders, sampled_recall
from lfsr_core.optics.display import load_display
from lfsr_core.pipeline.make import finish_frame
from tests.support.synthetic import write_reference, write_render
from tests.support.told import refuses


def test_a_lens_lost_by_the_mask_lowers_recall_and_still_counts_as_foreground(tmp_path):
    folder, reference = write_render(tmp_path / "f"), write_reference(tmp_path / "r")
    finish_frame(folder, "bicubic")
    whole = compare_folders(folder, reference)
    mask = read_mask(folder / MASK_FILE)
    lost = np.argwhere(mask)[: mask.sum() // 3]
    mask[tuple(lost.T)] = False
    write_mask(folder / MASK_FILE, mask)
    after = compare_folders(folder, reference)
    assert whole.recall == 1
    assert after.recall == pytest.approx(1 - len(lost) / (mask.sum() + len(lost)))
    assert after.ssim_eia_fg == pytest.approx(whole.ssim_eia_fg)


def test_a_frame_that_is_finished_anew_meanwhile_keeps_its_own_report(tmp_path, monkeypatch):
    folder, reference = write_render(tmp_path / "f"), write_reference(tmp_path / "r")
    finish_frame(folder, "bicubic")
    real = compare_module.compare

    def slow(*arguments, **options):
        finish_frame(folder, "nearest")
        return real(*arguments, **options)
    monkeypatch.setattr(compare_module, "compare", slow)
    refuses("was finished again while it was compared", compare_folders, folder, reference)
    report = read_json(folder / REPORT_FILE, "a report")
    assert (report["method"], report["metrics"]) == ("nearest", {})


def test_sampled_recall_is_unbiased_under_unequal_sampling():
    rng = np.random.default_rng(3)
    truth = rng.random((30, 40)) < 0.4
    mask = truth & (rng.random(truth.shape) < 0.8)
    inside, outside = np.argwhere(mask), np.argwhere(~mask)
    estimates = []
    for _ in range(300):
        listed = np.concatenate([rng.permutation(inside)[:60], rng.permutation(outside)[:20]])
        estimates.append(sampled_recall(mask, truth[tuple(listed.T)], tuple(map(tuple, listed))))
    assert np.mean(estimates) == pytest.approx((mask & truth).sum() / truth.sum(), abs=0.02)


def test_sampled_recall_is_unknown_with_few_samples_outside_the_mask():
    mask = np.zeros((4, 40), bool)
    mask[0] = True
    listed = tuple((row, column) for row, columns in ((0, 20), (1, 3)) for column in range(columns))
    assert sampled_recall(mask, np.ones(len(listed), bool), listed) is None


@pytest.mark.parametrize("display", ["mini", "small"])
def test_eia_exr_is_read_instead_of_computed_again(tmp_path, monkeypatch, display):
    display = load_display(display)
    assert display.ei_order == "flipped"
    folder = write_render(tmp_path / "f", display=display)
    reference = write_reference(tmp_path / "r", display=display)
    finish_frame(folder, "bicubic")
    made = compare_folders(folder, reference)
    finish_frame(folder, Finish("bicubic", linear_exr=True))
    monkeypatch.setattr(compare_module, "finished_linear", lambda *_: 1 / 0)
    kept = compare_folders(folder, reference)
    for name, value in vars(made).items():
        assert getattr(kept, name) == (pytest.approx(value, abs=2e-3 if "psnr" in name else 2e-4)
                              if isinstance(value, float) else value), name


def test_kept_linear_world_image_another_size_is_refused(tmp_path):
    folder, reference = write_render(tmp_path / "f"), write_reference(tmp_path / "r")
    finish_frame(folder, "bicubic")
    write_layers(folder / "eia.exr", {"color": np.zeros((8, 8, 3), np.float16)}, half=True)
    refuses("finish the frame again with a linear EXR", compare_folders, folder, reference)
