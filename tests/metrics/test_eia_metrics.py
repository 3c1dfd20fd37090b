"""The figures of an EIA against its reference, each against a plain computation of the same, and of whole folders."""

import dataclasses

import cv2
import numpy as np
import pytest

from lfsr_core.base.system import read_json
from lfsr_core.frames.frame import MASK_FILE, REPORT_FILE, Finish, write_report
from lfsr_core.images.color import srgb_decode, srgb_encode
from lfsr_core.images.image_files import read_mask, write_layers, write_mask
from lfsr_core.metrics import eia_metrics
from lfsr_core.metrics.eia_metrics import compare_folders, psnr, split_ssim, split_ssim_map
from lfsr_core.optics.rays import to_views
from lfsr_core.reconstruct.second_stage import finish_frame
from lfsr_lab.experiments.engine.truth import split_mse
from tests.support.finished import MINI, TALL
from tests.support.synthetic import frame_of, tiles, write_reference, write_render
from tests.support.told import refuses


def test_flip_grows_with_the_error_and_without_foreground_or_samples_there_is_none():
    image = textured_image()
    assert eia_metrics.mean_flip(image, image) == pytest.approx(0, abs=1e-6)
    slight, strong = (eia_metrics.mean_flip(np.clip(image + shift, 0, 1), image) for shift in (0.02, 0.2))
    assert 0.001 < slight < strong < 1
    score = compared(*eia_case(), LENSES, np.zeros_like(MASK))
    names = ("p", "ssim_eia_fg", "ssim_lens_fg", "psnr_fg", "ssim_views_fg")
    assert [score[name] for name in names] == [0, None, None, None, None]
    low = compared(*(values[:8] for values in eia_case()), (16, 1), MASK[3:4])  # too low for a window of SSIM
    assert {name for name in low if low[name] is None} == {"ssim_eia", "ssim_eia_fg", "ssim_eia_plain", "ssim_ceiling"}
    score = sampled(np.argwhere(MASK)[:10], *eia_case())
    assert score["ssim_lens"] is None and score["ssim_lens_fg"] is not None
    x, _, _ = eia_case()
    score = sampled([(3, 5), (8, 12), (0, 0), (4, 4), (11, 3)], x, x, x)
    assert score["ssim_lens_fg"] == pytest.approx(1, abs=1e-9) and score["psnr_fg"] is None


# A display of 16 × 12 lenses and 8 × 8 views, so 128 × 96 pixels.
LENSES = (16, 12)
MASK = np.zeros((12, 16), bool)
MASK[3:9, 4:13] = True


def eia_case(noise=0.02):
    """Scene-linear candidate and halves whose sRGB values differ as in the tests above."""
    image = textured_image(96, 128)
    return [srgb_decode(np.clip(x, 0, 1)).astype(np.float32)
            for x in (blurred(image), noisy(image, noise, 7), noisy(image, noise, 8))]


def compared(x, a, b, *rest, **more):
    return eia_metrics.compare(x, (a, b), *rest, **more)


def test_whole_comparison_reports_every_metric_from_its_own_pixels():
    from skimage.metrics import structural_similarity
    x, a, b = eia_case()
    score = compared(x, a, b, LENSES, MASK)
    assert tuple(score) == eia_metrics.METRIC_NAMES
    X, A, B = (srgb_encode(values) for values in (x, a, b))
    inside, local = np.repeat(np.repeat(MASK, 8, 0), 8, 1), split_ssim_map(X, A, B)
    assert score["p"] == pytest.approx(54 / 192) and score["ssim_eia"] == pytest.approx(split_ssim(X, A, B), abs=1e-9)
    assert score["ssim_eia_fg"] == pytest.approx(local[inside].mean(), abs=1e-9)  # the mask is away from the border
    alone = np.array([[split_ssim_map(*(values[8 * row:8 * row + 8, 8 * column:8 * column + 8] for values in (X, A, B)))
                       .mean() for column in range(16)] for row in range(12)])
    assert score["ssim_lens"] == pytest.approx(alone.mean(), abs=1e-6)
    assert score["ssim_lens_fg"] == pytest.approx(alone[MASK].mean(), abs=1e-6)
    assert score["psnr_fg"] == pytest.approx(psnr(np.mean(((X - A) * (X - B))[inside])), abs=1e-4)
    assert score["ssim_eia_plain"] == pytest.approx(structural_similarity(X, (A + B) / 2, **GAUSSIAN), abs=1e-5)
    assert score["ssim_ceiling"] == pytest.approx(structural_similarity(A, B, **GAUSSIAN), abs=1e-5)
    assert score["ssim_ceiling"] < score["ssim_eia_plain"] < score["ssim_eia"]
    views = [to_views(values, LENSES) for values in (X, A, B)]
    ssims = [split_ssim_map(*(v[row, column] for v in views))[MASK].mean() for row in range(8) for column in range(8)]
    assert score["ssim_views_fg"] == pytest.approx(np.mean(ssims), abs=1e-9)
    assert score["flip"] == pytest.approx(eia_metrics.mean_flip(X, (A + B) / 2), abs=1e-6)


def test_foreground_metrics_ignore_the_background_and_values_above_display_white_do_not_count():
    x, a, b = eia_case()
    before, worse = compared(x, a, b, LENSES, MASK), x.copy()
    worse[:8] = 1.0  # a row of background lenses, further than a window from the foreground
    after = compared(worse, a, b, LENSES, MASK)
    for name in ("ssim_eia_fg", "ssim_lens_fg", "psnr_fg"):
        assert after[name] == pytest.approx(before[name], abs=1e-9)
    assert after["ssim_eia"] < before["ssim_eia"] - 0.02
    bright = [values.copy() for values in (x, a, b)]
    for values, level in zip(bright, (3, 5, 7), strict=True):
        values[40:60, 60:80] = level
    assert compared(*bright, LENSES, MASK) == compared(*[np.clip(values, 0, 1) for values in bright], LENSES, MASK)


def sampled(chosen, x, a, b, mask=MASK):
    frame = frame_of(1, lens_list=tuple(map(tuple, chosen)))
    return compared(x, tiles(a, frame), tiles(b, frame), LENSES, mask, lens_list=frame.lens_list)


@pytest.fixture
def without_flip(monkeypatch):
    """FLIP of single lenses takes minutes where other programs use the processor."""
    monkeypatch.setattr(eia_metrics, "flip_evaluator", None)


def test_all_lenses_sampled_leave_no_interval(without_flip):
    everything = [(row, column) for row in range(12) for column in range(16)]
    x, a, b = eia_case()
    score, whole = sampled(everything, x, a, b), compared(x, a, b, LENSES, MASK)
    assert score["psnr_fg"] == pytest.approx(whole["psnr_fg"], abs=1e-5) and score["p"] == whole["p"]
    assert all(width in (None, 0) for width in score["ci95"].values())
    assert set(eia_metrics.SAMPLED_NAMES) == set(score) - {"lenses", "ci95", "notes"}
    for name in ("ssim_lens", "ssim_lens_fg"):
        assert score[name] == pytest.approx(whole[name], abs=1e-5), "the same number by the same name"


def test_intervals_hold_the_truth_about_95_times_in_100(without_flip):
    x, a, b = eia_case()
    everything = [(row, column) for row in range(12) for column in range(16)]
    truth, random = sampled(everything, x, a, b), np.random.default_rng(3)
    foreground, background = np.argwhere(MASK), np.argwhere(~MASK)
    hits = {name: 0 for name in ("ssim_lens", "ssim_lens_fg", "psnr_fg")}
    for _ in range(60):
        score = sampled([*random.permutation(foreground)[:25], *random.permutation(background)[:12]], x, a, b)
        for name in hits:
            hits[name] += abs(score[name] - truth[name]) <= score["ci95"][name]
    assert all(50 <= count <= 60 for count in hits.values()), hits


def test_strata_weigh_by_their_share_and_shapes_that_do_not_fit_are_errors():
    x, a, b = eia_case(noise=0)
    background = np.repeat(np.repeat(~MASK, 8, 0), 8, 1)
    x[background] = a[background]  # perfect there
    score = sampled([*np.argwhere(MASK)[::7], (0, 0), (11, 15)], x, a, b)
    assert score["ssim_lens"] == pytest.approx((score["p"] * score["ssim_lens_fg"] + (1 - score["p"])), abs=1e-6)
    x, a, b = eia_case()
    refuses(r"reference has shape \(96, 120, 3\)", compared, x, a[:, :120], b, LENSES, MASK)
    refuses("foreground mask has shape", compared, x, a, b, LENSES, MASK[:, :8])
    refuses("equal elemental images", compared, x, a, b, (15, 12), MASK)
    refuses("3 tiles of", compared, x, a[:8, :16], b[:8, :16], LENSES, MASK, lens_list=((0, 0), (1, 1), (2, 2)))


def test_a_lens_lost_by_the_mask_lowers_recall_and_still_counts_as_foreground(tmp_path):
    folder, reference = write_render(tmp_path / "f"), write_reference(tmp_path / "r")
    finish_frame(folder, "bicubic")
    whole, mask = compare_folders(folder, reference), read_mask(folder / MASK_FILE)
    lost = np.argwhere(mask)[: mask.sum() // 3]
    mask[tuple(lost.T)] = False
    write_mask(folder / MASK_FILE, mask)
    after = compare_folders(folder, reference)
    assert whole.recall == 1 and after.recall == pytest.approx(1 - len(lost) / (mask.sum() + len(lost)))
    assert after.ssim_eia_fg == pytest.approx(whole.ssim_eia_fg)


def test_sampled_recall_is_unbiased_and_unknown_with_few_samples_outside_the_mask():
    rng = np.random.default_rng(3)
    truth = rng.random((30, 40)) < 0.4
    mask = truth & (rng.random(truth.shape) < 0.8)
    inside, outside = np.argwhere(mask), np.argwhere(~mask)
    estimates = []
    for _ in range(300):
        listed = np.concatenate([rng.permutation(inside)[:60], rng.permutation(outside)[:20]])
        estimates.append(eia_metrics.sampled_recall(mask, truth[tuple(listed.T)], tuple(map(tuple, listed))))
    assert np.mean(estimates) == pytest.approx((mask & truth).sum() / truth.sum(), abs=0.02)
    mask = np.zeros((4, 40), bool)
    mask[0] = True
    listed = tuple((row, column) for row, columns in ((0, 20), (1, 3)) for column in range(columns))
    assert eia_metrics.sampled_recall(mask, np.ones(len(listed), bool), listed) is None


@pytest.mark.parametrize("display", [MINI, TALL], ids=["mini", "tall"])
def test_eia_exr_is_read_instead_of_computed_again(tmp_path, monkeypatch, display):
    assert display.ei_order == "flipped"
    folder = write_render(tmp_path / "f", display=display)
    reference = write_reference(tmp_path / "r", display=display)
    finish_frame(folder, "bicubic")
    made = compare_folders(folder, reference)
    finish_frame(folder, Finish("bicubic", linear_exr=True))
    monkeypatch.setattr(eia_metrics, "finished_linear", lambda *_: 1 / 0)
    kept = compare_folders(folder, reference)
    for name, value in vars(made).items():
        assert getattr(kept, name) == (pytest.approx(value, abs=2e-3 if "psnr" in name else 2e-4)
                              if isinstance(value, float) else value), name


def test_a_frame_finished_meanwhile_keeps_its_report_and_a_linear_image_of_another_size_is_refused(tmp_path,
                                                                                                   monkeypatch):
    folder, reference = write_render(tmp_path / "f"), write_reference(tmp_path / "r")
    write_report(folder, dataclasses.replace(finish_frame(folder, "bicubic"), neighbours=(1, 3)))
    refuses(r"with frames \(1, 3\), but .* finish it again", compare_folders, folder, reference)
    write_layers(folder / "eia.exr", {"color": np.zeros((8, 8, 3), np.float16)}, half=True)
    refuses("finish the frame again with a linear EXR", compare_folders, folder, reference)
    finish_frame(folder, "bicubic")
    real = eia_metrics.compare

    def slow(*arguments, **options):
        finish_frame(folder, "nearest")
        return real(*arguments, **options)
    monkeypatch.setattr(eia_metrics, "compare", slow)
    refuses("was finished again while it was compared", compare_folders, folder, reference)
    report = read_json(folder / REPORT_FILE, "a report")
    assert (report["method"], report["metrics"]) == ("nearest", {})


@pytest.mark.parametrize("shape", [(96, 128), (23, 31), (600, 40)])  # the last is higher than one band
def test_equal_halves_give_the_ssim_of_scikit_image(shape):
    from skimage.metrics import structural_similarity
    image = textured_image(*shape)
    candidate = blurred(image)
    expected, of_pixels = structural_similarity(candidate, image, full=True, **GAUSSIAN)
    assert expected < 0.98
    np.testing.assert_allclose(split_ssim_map(candidate, image, image), of_pixels, atol=1e-9)
    assert split_ssim(candidate, image, image) == pytest.approx(expected, abs=1e-6)


def test_halves_count_alike_and_stacked_images_do_not_see_each_other():
    from skimage.metrics import peak_signal_noise_ratio
    image, candidate = textured_image(), blurred(textured_image())
    assert split_ssim(candidate, image, candidate) == pytest.approx(split_ssim(candidate, candidate, image), abs=1e-12)
    expected = peak_signal_noise_ratio(image, candidate, data_range=1)
    assert psnr(split_mse(candidate, image, image)) == pytest.approx(expected, abs=1e-9) and psnr(0.0) is None
    assert psnr(-1e-9) is None
    stack = np.stack([textured_image(20, 24, seed) for seed in range(200)])  # more than one call's worth of channels
    candidates = np.stack([blurred(image) for image in stack])
    together = eia_metrics.stacked_ssim(candidates, stack, stack)
    for index in (0, 99, 199):
        alone = split_ssim_map(candidates[index], stack[index], stack[index]).mean(-1)
        np.testing.assert_allclose(together[index], alone, atol=1e-12)


@pytest.mark.parametrize(("noise", "tolerance"), [(0.01, 0.001), (0.02, 0.002), (0.03, 0.008), (0.04, 0.02)])
def test_noise_of_the_reference_cancels(noise, tolerance):
    """In split SSIM up to ``tolerance``, in MSE up to 0.5 %; the plain figures move ten times as far."""
    image = textured_image(192, 256)
    candidate = blurred(image)
    true_ssim, true_mse = split_ssim(candidate, image, image), split_mse(candidate, image, image)
    halves = [(noisy(image, noise, 100 + i), noisy(image, noise, 200 + i)) for i in range(6)]
    split = np.mean([split_ssim(candidate, a, b) for a, b in halves])
    squared = np.mean([split_mse(candidate, a, b) for a, b in halves])
    assert split == pytest.approx(true_ssim, abs=tolerance) and squared == pytest.approx(true_mse, rel=0.005)
    plain = np.mean([split_ssim(candidate, *[(a + b) / 2] * 2) for a, b in halves])
    plain_squared = np.mean([np.mean((candidate - (a + b) / 2) ** 2) for a, b in halves])
    assert true_ssim - plain > 10 * tolerance and plain_squared - true_mse == pytest.approx(noise**2 / 2, rel=0.05)


@pytest.mark.parametrize("freedom", [3, 5, 11, 40, 1000])
def test_small_samples_get_students_intervals(freedom):
    import scipy.stats
    assert eia_metrics.student_95(freedom) == pytest.approx(scipy.stats.t.ppf(0.975, freedom), rel=0.01)


# The settings under which scikit-image computes the SSIM of Wang et al.
GAUSSIAN = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "data_range": 1, "channel_axis": 2}


def textured_image(height=96, width=128, seed=0):
    """Texture on the left, almost flat on the right; (H, W, 3) in [0.2, 0.8]."""
    random = np.random.default_rng(seed)
    image = cv2.resize(random.random((height // 4, width // 4, 3)), (width, height), interpolation=cv2.INTER_CUBIC)
    image[:, width // 2:] = 0.5 + 0.02 * image[:, width // 2:]
    return 0.2 + 0.6 * np.clip(image, 0, 1)


def blurred(image, noise=0.01, seed=1):
    """A candidate: ``image`` blurred, with Gaussian noise."""
    return cv2.GaussianBlur(image, (0, 0), 1.2) + np.random.default_rng(seed).normal(0, noise, image.shape)


def noisy(image, noise, seed):
    """A render of ``image`` with Gaussian noise of standard deviation ``noise``."""
    return image + np.random.default_rng(seed).normal(0, noise, image.shape)
