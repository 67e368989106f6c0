"""The tension as it is stated everywhere: over all model classes, with both of its intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from shm.values.hanger import Limits
from shm.values.posterior import Averaged, Posterior, Selection
from shm.values.rounding import (
    MOST_DECIMALS,
    ForceUnit,
    force_unit,
    tension_and_interval,
    with_interval,
)

_MIN_STATED = 0.01  # ten of a thousand draws: they tell a smaller probability to no digit


def averaged_now(
    posterior: Posterior, selection: Selection | None = None, limits: Limits | None = None
) -> Averaged:
    """Return the tension by a `posterior`, averaged over the classes of a `selection`."""
    return selection_now(posterior, selection).averaged_with(limits)


def selection_now(posterior: Posterior, selection: Selection | None = None) -> Selection:
    """Return the classes of a `selection` as they are by a later `posterior` of one of them.

    Where later tests are updated in the selected class alone, the others follow as it has moved
    since: of a change they say the same, of the tension itself each its own.
    """
    known = selection is not None and math.isfinite(sum(selection.probabilities))
    compared = list(selection.posteriors) if selection is not None and known else []
    same = [each for each in compared if _of_one_class(each, posterior)]
    if selection is None or not same:
        return Selection((posterior,), (1.0,))
    moved = float(posterior.tension_n.mean() / same[0].tension_n.mean())
    probable = list(zip(compared, selection.probabilities, strict=True))
    others = [(each, share) for each, share in probable if each is not same[0]]
    now = [replace(each, nominal_tension_n=each.nominal_tension_n * moved) for each, _ in others]
    probability = next(share for each, share in probable if each is same[0])
    return Selection((posterior, *now), (probability, *(share for _, share in others)))


def _of_one_class(one: Posterior, other: Posterior) -> bool:
    return (one.model, one.priors) == (other.model, other.priors)


@dataclass(frozen=True)
class StatedTension:
    """A tension in words; an empty text is not known, or not asked for.

    `tension` is `654 kN`, `interval` its absolute 90 % credible interval, `640 to 671 kN`.
    `repeatability` is the standard deviation with which the same test would give it again. `above`
    and `slack` are probabilities of a tension beyond the owner's limits.
    """

    tension: str
    interval: str
    repeatability: str
    above: str
    slack: str

    @property
    def headline(self) -> str:
        """Return `654 kN (90 % credible interval 640 to 671 kN)`."""
        return with_interval(self.tension, self.interval)

    @property
    def sentences(self) -> tuple[str, ...]:
        """All of it, one number a sentence, the tension first."""
        found = [f"Tension {self.headline}, absolute."]
        if self.repeatability:
            found.append(
                f"Repeatability {self.repeatability} (standard deviation): for changes between "
                "tests."
            )
        if self.above:
            found.append(f"Probability that the tension exceeds its limit: {self.above}.")
        if self.slack:
            found.append(f"Probability that the hanger is slack: {self.slack}.")
        return tuple(found)


def stated(averaged: Averaged, unit: ForceUnit | None = None) -> StatedTension:
    """Return a tension in words, rounded to two digits of its interval's half width."""
    tension_n, sd_n = averaged.tension_n, averaged.repeatability_sd_n
    unit = unit or force_unit(tension_n.mean)
    repeats = unit.of(sd_n)
    return StatedTension(
        *tension_and_interval(tension_n.mean, tension_n.q05, tension_n.q95, unit),
        f"{repeats:.{decimals(repeats)}f} {unit.name}" if math.isfinite(repeats) else "",
        _probability(averaged.probability_above_limit),
        _probability(averaged.probability_slack),
    )


def decimals(size: float) -> int:
    """Return decimals that show two significant digits."""
    if not (math.isfinite(size) and size > 0):
        return 1
    return min(MOST_DECIMALS, max(0, 1 - math.floor(math.log10(size))))


def _probability(value: float) -> str:
    """Return as many digits as a thousand draws can tell; empty where there is no limit."""
    if math.isnan(value):
        return ""
    if value < _MIN_STATED:
        return f"below {_MIN_STATED}"
    return f"above {1 - _MIN_STATED}" if value > 1 - _MIN_STATED else f"{value:.2f}"
