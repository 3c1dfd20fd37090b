"""95 % intervals of means over random lenses, and the quantiles that they need."""

from __future__ import annotations

import math

from lfsr_core.base.arrays import Array, Mask
from lfsr_core.metrics.split_ssim import mean_of

NORMAL_95 = 1.959964  # standard errors around the mean that contain 95 % of samples
NORMAL_ONE_SIDED = 1.644854  # standard errors below which 95 % of samples lie
Estimate = tuple[float | None, float | None]  # mean and half-width of its 95 % interval; None: unknown


def stratum(values: Array, population: int) -> Estimate:
    """Estimate the mean over ``population`` lenses from the ``values`` of a random sample."""
    if len(values) == 0:
        return None, None
    if len(values) == population:
        return mean_of(values), 0.0
    if len(values) == 1:
        return mean_of(values), None
    error = math.sqrt(values.var(ddof=1) / len(values) * (1 - len(values) / population))
    return mean_of(values), student_95(len(values) - 1) * error


def stratified(values: Array, in_foreground: Mask, mask: Mask) -> Estimate:
    """Estimate the mean over all lenses from samples inside and outside ``mask`` (sy, sx)."""
    total, squared_width = 0.0, 0.0
    for chosen, population in ((in_foreground, int(mask.sum())), (~in_foreground, int((~mask).sum()))):
        if population == 0:
            continue
        mean, width = stratum(values[chosen], population)
        if mean is None:
            return None, None
        total += mean * population / mask.size
        squared_width = math.nan if width is None else squared_width + (width * population / mask.size) ** 2
    return total, None if math.isnan(squared_width) else math.sqrt(squared_width)


def student_95(freedom: int) -> float:
    """Two-sided 95 % quantile of Student's t, within 1 % from 3 degrees of freedom on."""
    return student(NORMAL_95, freedom)


def student(z: float, freedom: float) -> float:
    """Quantile of Student's t at the probability of the normal quantile ``z``, within 2 % from 2 degrees of freedom on.

    Cornish-Fisher expansion (Abramowitz and Stegun 26.7.5).
    """
    terms = ((z**3 + z) / 4, (5 * z**5 + 16 * z**3 + 3 * z) / 96, (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384)
    return z + sum(term / freedom ** (power + 1) for power, term in enumerate(terms))
