"""Scores of sampled lenses: the correction for a noisy reference."""

import numpy as np

from lfsr_core.metrics.split_ssim import stacked_ssim
from lfsr_core.plan import sample as plan_sample
from lfsr_core.plan.sample import split_scores


def test_correction_takes_some_of_the_references_noise_out(monkeypatch):
    monkeypatch.setattr(plan_sample, "srgb_encode", lambda image: image)  # noise that is normal in display values
    random, noise = np.random.default_rng(0), 0.08
    exact = np.full((600, 24, 24, 1), 0.5)
    exact[:, :, 12:] += 0.2 * np.sin(np.arange(12) / 1.7)[:, None]
    image = exact + random.normal(0, 0.015, exact.shape)
    true = float(stacked_ssim(image, exact, exact).mean())
    quarters = [exact + random.normal(0, noise, exact.shape) for _ in range(4)]
    plain = float(stacked_ssim(image, *(np.mean(quarters[half], 0) for half in (np.s_[:2], np.s_[2:]))).mean())
    corrected = float(split_scores(image, quarters).mean())
    assert plain < true - 0.003 and abs(corrected - true) < abs(plain - true)
