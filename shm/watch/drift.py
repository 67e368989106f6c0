"""First form of the drift decision: the posterior of a test against the posterior of the baseline.

Both posteriors are taken as independent, so that a model error which they share widens the shift
instead of cancelling: an alert may come late, but rests on what the two tests say by themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from shm.models import described
from shm.values import PLANES, Alert, Drift, FloatArray, Hanger, Posterior, Thresholds

TENSION = "tension"
_NINETY_PERCENT = 1.645


@dataclass(frozen=True, eq=False)
class _Comparison:
    """Samples (n,) of one quantity before and after, and of its shift."""

    quantity: str
    before: FloatArray
    after: FloatArray
    shift: FloatArray
    threshold: float

    @property
    def probability(self) -> float:
        """That the shift is beyond the threshold, in the likelier direction."""
        down, up = np.mean(self.shift < -self.threshold), np.mean(self.shift > self.threshold)
        return float(max(down, up))


def assess(
    baseline: Posterior, current: Posterior, hanger: Hanger, *, test: str, time: datetime
) -> tuple[Drift, ...]:
    """The shift of tension and, where the model class has springs, of the end stiffness.

    Tension shifts are fractions of the baseline; stiffness shifts are decades of the two ends'
    common stiffness 2/(1/k_deck + 1/k_arch), because frequencies alone cannot tell the ends apart.
    """
    return tuple(
        Drift(
            hanger=hanger.id,
            test=test,
            time=time,
            quantity=comparison.quantity,
            baseline=float(comparison.before.mean()),
            value=float(comparison.after.mean()),
            shift_mean=float(comparison.shift.mean()),
            shift_sd=float(comparison.shift.std(ddof=1)),
            threshold=comparison.threshold,
            probability=comparison.probability,
        )
        for comparison in _comparisons(baseline, current, hanger)
    )


def _comparisons(baseline: Posterior, current: Posterior, hanger: Hanger) -> list[_Comparison]:
    rng, limits = np.random.default_rng(current.seed), hanger.thresholds
    before, after = _paired(baseline.tension_n, current.tension_n, rng)
    shift = after / before - 1
    comparisons = [_Comparison(TENSION, before, after, shift, limits.tension_shift_fraction)]
    limit, now = limits.stiffness_shift_decades, end_stiffness(current, hanger)
    for quantity, earlier in end_stiffness(baseline, hanger).items():
        if quantity in now:
            before, after = _paired(earlier, now[quantity], rng)
            comparisons.append(_Comparison(quantity, before, after, after - before, limit))
    return comparisons


def end_stiffness(posterior: Posterior, hanger: Hanger) -> dict[str, FloatArray]:
    """log10 of the two ends' common stiffness in N m/rad (samples,), for planes with springs."""
    model = described(posterior.model, hanger)
    theta = np.column_stack([posterior.parameter(name) for name in model.parameter_names])
    deck, arch = model.springs_n_m_rad(theta)
    flexibility = 1 / deck + 1 / arch
    return {
        f"{plane}_end_stiffness": np.log10(2 / values)
        for plane, values in zip(PLANES, flexibility.T, strict=True)
        if np.all(values > 0)
    }


def _paired(
    before: FloatArray, after: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Independent pairs from the two posteriors."""
    n = max(len(before), len(after))
    return rng.choice(before, n), rng.choice(after, n)


def decide(drifts: Sequence[Drift], thresholds: Thresholds) -> Alert | None:
    """An alert where any shift is beyond its threshold with the probability asked for.

    Its key names what moved and which way, so that a standing condition is one alert.
    """
    moved = [drift for drift in drifts if drift.probability >= thresholds.alert_probability]
    if not moved:
        return None
    first = moved[0]
    ways = [f"{drift.quantity}-{'down' if drift.shift_mean < 0 else 'up'}" for drift in moved]
    return Alert(
        key=f"hanger-{first.hanger}:{':'.join(ways)}",
        hanger=first.hanger,
        test=first.test,
        time=first.time,
        message=f"Hanger {first.hanger}: {'; '.join(_sentence(drift) for drift in moved)}.",
        drifts=tuple(moved),
    )


def _sentence(drift: Drift) -> str:
    """What moved, by how much (90 % interval), and how sure that is."""
    low, high = (drift.shift_mean + s * _NINETY_PERCENT * drift.shift_sd for s in (-1, 1))
    if drift.quantity == TENSION:
        return (
            f"tension moved from {drift.baseline / 1e3:.1f} to {drift.value / 1e3:.1f} kN, "
            f"{drift.shift_mean:+.1%} (90 % interval {low:+.1%} to {high:+.1%}); probability of a "
            f"shift beyond {drift.threshold:.1%}: {drift.probability:.3f}"
        )
    return (
        f"{drift.quantity.replace('_', ' ')} moved from 10^{drift.baseline:.2f} to "
        f"10^{drift.value:.2f} N m/rad, {drift.shift_mean:+.2f} decades (90 % interval "
        f"{low:+.2f} to {high:+.2f}); probability of a shift beyond {drift.threshold:g} "
        f"decades: {drift.probability:.3f}"
    )
