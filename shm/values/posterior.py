"""What inference finds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from shm.values.kinds import FloatArray, Plane


@dataclass(frozen=True, eq=False)
class Prior:
    """Independent uniform priors: `lower` and `upper` have shape (parameters,)."""

    names: tuple[str, ...]
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True)
class Summary:
    """One quantity of a posterior in numbers; `q05` and `q95` bound 90 % of it."""

    mean: float
    sd: float
    q05: float
    q50: float
    q95: float

    @classmethod
    def of(cls, samples: FloatArray) -> Self:
        """Of equally weighted draws, shape (samples,)."""
        q05, q50, q95 = np.quantile(samples, [0.05, 0.5, 0.95])
        spread = float(samples.std(ddof=1))
        return cls(float(samples.mean()), spread, float(q05), float(q50), float(q95))


@dataclass(frozen=True)
class PredictedFrequency:
    """A frequency with the uncertainty of the parameters (thesis 4.14) beside its measurement."""

    plane: Plane
    order: int
    mean_hz: float
    sd_hz: float
    measured_hz: float


@dataclass(frozen=True, eq=False)
class Posterior:
    """Samples of one model class's parameters given modal tests, and its evidence.

    `samples` (samples, parameters) are equally weighted draws; `log_likelihood` (samples,).
    `most_probable` (parameters,) has the largest posterior density. `r_hat` compares independent
    batches of draws, the worst parameter (1 is converged). `method` is the way it was sampled:
    `tmcmc` or `textbook` from scratch, or from a known posterior `re-weighted` or by an `ensemble`.
    """

    model: str
    hanger: int | None
    names: tuple[str, ...]
    samples: FloatArray
    log_likelihood: FloatArray
    most_probable: FloatArray
    nominal_tension_n: float
    log_evidence: float
    log_evidence_sd: float
    effective_sample_size: float
    r_hat: float
    evaluations: int
    predicted: tuple[PredictedFrequency, ...]
    tests: tuple[str, ...]
    seed: int
    seconds: float
    method: str = "tmcmc"

    def parameter(self, name: str) -> FloatArray:
        """Samples of one parameter, shape (samples,)."""
        return self.samples[:, self.names.index(name)]

    @property
    def tension_n(self) -> FloatArray:
        """Samples of the tension, shape (samples,)."""
        return self.parameter("theta_F") * self.nominal_tension_n


@dataclass(frozen=True, eq=False)
class Selection:
    """Model classes compared on the same tests, most probable first."""

    posteriors: tuple[Posterior, ...]
    probabilities: tuple[float, ...]

    @property
    def selected(self) -> Posterior:
        return self.posteriors[0]
