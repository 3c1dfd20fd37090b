"""Mean accuracy of all lenses, with bounds, from a stratified random sample of them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.metrics.intervals import NORMAL_ONE_SIDED, student

LEAST_FOR_REGRESSION = 12  # lenses of a stratum, beyond the number of its covariates


@dataclasses.dataclass(frozen=True)
class Estimate:
    """Accuracy of a whole frame, from a sample of its lenses."""

    mean: float  # over all lenses that count
    # one-sided bounds of the mean, at 95 % unless another certainty is asked for
    low: float
    high: float
    error: float  # standard error of the mean
    lenses: int  # number of sampled lenses


@dataclasses.dataclass(frozen=True)
class Stratum:
    """Random lenses of one part of the display."""

    population: int  # lenses of the part
    values: Array  # (n,) accuracy of the sampled lenses
    inside: Array  # (n,) bool: the sampled lenses that count for the metric
    covariates: Array | None = None  # (n, k): known of every lens of the part, and may explain the values
    population_means: Array | None = None  # (k,): means of the covariates over the part


def estimate(strata: Sequence[Stratum], z: float = NORMAL_ONE_SIDED) -> Estimate:
    """Estimate the mean of ``values`` over all lenses that are ``inside``, from the samples of all strata.

    ``z``: normal quantile of the bounds' certainty.
    A ratio estimator over strata, with linear regression on the covariates where there are enough lenses, a correction
    for finite populations, Student's t, and Hall's correction for skewness, since a few bad lenses among many good
    ones are the rule. LfsrError if no sampled lens is inside, or a single lens represents a larger stratum.
    """
    strata = [stratum for stratum in strata if stratum.population]
    _check(strata)
    parts = [_part(stratum) for stratum in strata]
    weight = sum(s.population * s.inside.mean() for s in strata)
    mean = float(sum(s.population * part.mean for s, part in zip(strata, parts, strict=True)) / weight)
    residuals = [np.where(s.inside, part.deviations + part.mean - mean, 0.0) if part.covariates == 0
                 else part.deviations for s, part in zip(strata, parts, strict=True)]
    spreads = [_spread(s, part, values) for s, part, values in zip(strata, parts, residuals, strict=True)]
    variance = sum(spread for spread, _ in spreads)
    error = math.sqrt(variance) / float(weight)
    lenses = sum(len(s.values) for s in strata)
    if variance <= 0:
        return Estimate(mean, mean, mean, 0.0, lenses)
    t = student(z, variance**2 / sum(spread**2 / freedom for spread, freedom in spreads))
    shift = _skewness(np.concatenate(residuals)) * (1 + 2 * t * t) / (6 * math.sqrt(lenses))
    return Estimate(mean, mean - error * (t - min(shift, 0.0)), mean + error * (t + max(shift, 0.0)), error, lenses)


def _check(strata: Sequence[Stratum]) -> None:
    if not any(stratum.inside.any() for stratum in strata):
        raise LfsrError("no sampled lens shows any foreground: choose another subject, or --metric ssim_lens")
    for stratum in strata:
        if len(stratum.values) < min(2, stratum.population):
            raise LfsrError(f"{len(stratum.values)} sampled lens represents {stratum.population}, but at least 2 are "
                            "needed: sample more lenses")


@dataclasses.dataclass(frozen=True)
class _Part:
    """Estimate of one stratum."""

    mean: float  # over all its lenses; those that are not inside count as 0
    deviations: Array  # (n,): of each lens from the mean
    covariates: int  # number of covariates used


def _part(stratum: Stratum) -> _Part:
    """Estimate by regression where covariates are usable (with jackknife deviations), else by the plain mean."""
    counted = np.where(stratum.inside, stratum.values, 0.0)
    x = _useful(stratum)
    if x is None:
        return _Part(float(counted.mean()), stratum.values - counted.mean(), 0)
    design, target = np.insert(x, 0, 1.0, axis=1), np.insert(np.zeros(x.shape[1]), 0, 1.0)
    inverse = np.linalg.pinv(design.T @ design)
    coefficients = inverse @ design.T @ counted
    leverage = np.einsum("ni,ij,nj->n", design, inverse, design)
    weights = design @ inverse @ target
    residuals = (counted - design @ coefficients) / np.maximum(1 - leverage, 1e-6)
    return _Part(float(target @ coefficients), len(x) * weights * residuals, x.shape[1])


def _useful(stratum: Stratum) -> Array | None:
    """Covariates (n, k) that vary, minus their population means; None if there are too few lenses for them."""
    x, means = stratum.covariates, stratum.population_means
    if x is None or means is None or len(x) < LEAST_FOR_REGRESSION + x.shape[1] or not stratum.inside.all():
        return None
    # A covariate that hardly varies in the sample would be extrapolated from.
    varies = x.std(0) > 1e-6
    return (x - means)[:, varies] if varies.any() else None


def _spread(stratum: Stratum, part: _Part, residuals: Array) -> tuple[float, float]:
    """Variance of the stratum's contribution to the total, and its degrees of freedom."""
    count, population = len(residuals), stratum.population
    squares = float(((residuals - residuals.mean()) ** 2).sum())
    variance = squares / max(count - 1, 1)
    return population**2 * (1 - count / population) * variance / count, max(count - 1 - part.covariates, 1)


def _skewness(residuals: Array) -> float:
    centred = residuals - residuals.mean()
    deviation = centred.std()
    return float(np.mean(centred**3) / deviation**3) if deviation > 0 else 0.0
