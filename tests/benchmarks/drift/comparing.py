"""Every rule's limit for the same rate of false alarms, and what the rule then makes of changes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import gamma

from tests.benchmarks.drift.outcomes import OURS, RIVALS, Outcome
from tests.benchmarks.drift.scenarios import QUIET

ASKED_YEARS = 50.0


@dataclass(frozen=True)
class FalseAlarms:
    """First alarms without cause, and the hanger-years until them or the end."""

    count: int
    years: float

    @property
    def rate(self) -> float:
        return self.count / self.years

    @property
    def interval(self) -> tuple[float, float]:
        """90 % of the rate: Jeffreys' prior of a Poisson rate."""
        low, high = (
            float(gamma.ppf(share, self.count + 0.5, scale=1 / self.years))
            for share in (0.05, 0.95)
        )
        return low if self.count else 0.0, high


@dataclass(frozen=True)
class Delays:
    """In tests, by hanger; infinite for never. `spoilt` alarmed before the change."""

    tests: tuple[float, ...]
    spoilt: int

    def quantile(self, share: float) -> float:
        """No value between two; infinite where too many were never detected."""
        if not self.tests:
            return math.nan
        return float(np.quantile(self.tests, share, method="inverted_cdf"))

    def detected_within(self, tests: int) -> float:
        """The share detected by then."""
        return float(np.mean(np.array(self.tests) <= tests)) if self.tests else math.nan


def of_scenario(outcomes: Sequence[Outcome], name: str) -> list[Outcome]:
    return [each for each in outcomes if each.scenario == name]


def false_alarms(outcomes: Sequence[Outcome], rule: str, limit: float) -> FalseAlarms:
    counted = [each.quiet_years(rule, limit) for each in outcomes]
    return FalseAlarms(sum(each for each, _ in counted), sum(years for _, years in counted))


def delays(outcomes: Sequence[Outcome], rule: str, limit: float) -> Delays:
    found = [each.delay(rule, limit) for each in outcomes if each.changed_at is not None]
    return Delays(tuple(x for x in found if not math.isnan(x)), sum(map(math.isnan, found)))


def tuned(quiet: Sequence[Outcome], rule: str, rate: float) -> float:
    """The lowest limit at which a rule's rate of false alarms is at most `rate`.

    A rule alarms where its statistic is beyond its highest so far: only those can be limits.
    """
    highest = np.sort([max(each.statistics[rule]) for each in quiet])[::-1]
    limits = [value for value in highest if false_alarms(quiet, rule, value).rate <= rate]
    return float(min(limits, default=highest[0]))


def limits_at(outcomes: Sequence[Outcome], ours: float) -> dict[str, float]:
    """The rivals' limits at our rate of false alarms, and our own limit."""
    quiet = of_scenario(outcomes, QUIET.name)
    rate = false_alarms(quiet, OURS, ours).rate
    return {OURS: ours, **{rule: tuned(quiet, rule, rate) for rule in RIVALS}}


def limits_for(outcomes: Sequence[Outcome], rate: float) -> dict[str, float]:
    """All rules' limits for one rate, ours too."""
    quiet = of_scenario(outcomes, QUIET.name)
    return {rule: tuned(quiet, rule, rate) for rule in (OURS, *RIVALS)}


def verdicts(outcomes: Sequence[Outcome], limit: float) -> Mapping[str, int]:
    """How often the watch named what, in its first alarm after the change."""
    found = [each.verdict(limit) for each in outcomes]
    return {kind: found.count(kind) for kind in sorted(set(found)) if kind}
