"""Scores of sampled lenses: the correction for a noisy reference, and what may explain a lens's accuracy."""

from __future__ import annotations

import numpy as np
import pytest

from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.metrics.split_ssim import stacked_ssim
from lfsr_core.plan import score
from lfsr_core.plan.score import SampledReference, Scores, split_scores


@pytest.mark.parametrize(("denoiser", "rows"), [(False, 10), (True, 10), (True, 1)])
def test_features_tell_noisy_and_detailed_lenses_apart(monkeypatch, denoiser, rows):
    monkeypatch.setattr(score, "is_available", lambda: denoiser)
    random = np.random.default_rng(0)
    color = np.full((6, 6, rows, 10, 3), 0.5, np.float32)
    color[2:4] += random.normal(0, 0.15, color[2:4].shape)
    color[4:, ..., ::5, :] = 0.1
    alpha = np.ones((6, 6, rows, 10, 1), np.float32)
    alpha[:, 3:, :, 5:] = 0
    found = score.features(LowResEIA(np.maximum(color, 0), alpha, 4, 4, parallax=(True, rows > 1)))
    coverage, noise, detail = found[..., 0], found[..., 1], found[..., -1]
    assert np.allclose(coverage[:, :3], 1) and np.allclose(coverage[:, 3:], 0.5)
    if denoiser:
        assert noise[2:4].mean() < noise[:2].mean() - 0.05
        assert detail[4:].mean() > 3 * detail[:2].mean()
    else:
        assert noise[2:4].mean() > noise[:2].mean() + 0.05


def test_correction_takes_some_of_the_references_noise_out():
    random, noise = np.random.default_rng(0), 0.08
    exact = np.full((600, 24, 24, 1), 0.5)
    exact[:, :, 12:] += 0.2 * np.sin(np.arange(12) / 1.7)[:, None]
    image = exact + random.normal(0, 0.015, exact.shape)
    true = float(stacked_ssim(image, exact, exact).mean())

    class Shown(SampledReference):
        """Noise that is normal in display values, so that nothing but the metric is tested."""

        def pair(self, first, second):
            return tuple(np.mean([self.quarters[n] for n in names], 0) for names in (first, second))
    quarters = tuple(exact + random.normal(0, noise, exact.shape) for _ in range(4))
    scores = split_scores(image, Shown(quarters, np.ones(600, bool), noise))
    plain = float(scores.full.mean())
    assert plain < true - 0.003 and scores.gain > 0
    assert abs(scores.values.mean() - true) < abs(plain - true)
    halves = [Scores(scores.full[rows], scores.less[rows]) for rows in (slice(200), slice(200, None))]
    assert np.array_equal((halves[0] + halves[1]).values, scores.values), "as if all lenses had come at once"
