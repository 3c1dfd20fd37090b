"""The mean over all lenses, with bounds, from a stratified random sample of them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.metrics.intervals import NORMAL_ONE_SIDED, student

LEAST_FOR_REGRESSION = 12  # lenses per stratum and beyond its covariates


@dataclasses.dataclass(frozen=True)
class Estimate:
    """Accuracy of a whole frame, from a sample of its lenses."""

    mean: float  # over all lenses that count
    # low, high: one-sided 95 % bounds of it
    low: float
    high: float
    error: float  # its standard error
    lenses: int  # how many were looked at


@dataclasses.dataclass(frozen=True)
class Stratum:
    """Random lenses of one part of the display."""

    population: int  # lenses of the part
    values: Array  # (n,) accuracy of the sampled ones
    inside: Array  # (n,) bool, which of them count for the metric at all
    covariates: Array | None = None  # (n, k), what is known of every lens of the part and may explain the values
    population_means: Array | None = None  # (k,) means of the covariates over the part


def estimate(strata: Sequence[Stratum], z: float = NORMAL_ONE_SIDED) -> Estimate:
    """Mean of ``values`` over all lenses that are ``inside``, from every stratum's sample.

    A ratio estimator over strata, with linear regression on the covariates where
    there are enough lenses, correction for finite populations, Student's t and
    Hall's correction for skewness: a few bad lenses among many good ones are the
    rule. LfsrError if no sampled lens is inside, or one lens stands for many.
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
            raise LfsrError(f"{len(stratum.values)} lens stands for {stratum.population}, but at least 2 must: "
                            "sample more lenses")


@dataclasses.dataclass(frozen=True)
class _Part:
    """What a stratum's sample says."""

    mean: float  # over inside and outside lenses, which count as 0
    deviations: Array  # (n,) of each lens from it
    covariates: int  # how many were of use


def _part(stratum: Stratum) -> _Part:
    """By regression where covariates are of use, else plainly; deviations then as a jackknife sees them."""
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
    """Covariates (n, k) less their population means, those that vary; None where lenses are too few for them."""
    x = stratum.covariates
    if x is None or len(x) < LEAST_FOR_REGRESSION + x.shape[1] or not stratum.inside.all():
        return None
    # One that hardly varies here explains nothing and would be extrapolated from.
    varies = x.std(0) > 1e-6
    return (x - stratum.population_means)[:, varies] if varies.any() else None


def _spread(stratum: Stratum, part: _Part, residuals: Array) -> tuple[float, float]:
    """Variance of the stratum's share of the total, and its degrees of freedom."""
    count, population = len(residuals), stratum.population
    squares = float(((residuals - residuals.mean()) ** 2).sum())
    variance = squares / max(count - 1, 1)
    return population**2 * (1 - count / population) * variance / count, max(count - 1 - part.covariates, 1)


def _skewness(residuals: Array) -> float:
    centred = residuals - residuals.mean()
    deviation = centred.std()
    return float(np.mean(centred**3) / deviation**3) if deviation > 0 else 0.0
