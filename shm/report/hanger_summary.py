"""The state of one hanger in one value, which report, page, status, alert and hook show."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from functools import cached_property
from typing import Any

from shm.documents import averaged_document
from shm.report.formatting import NORMAL_90, Interval
from shm.report.hanger_status import HangerMessage, Status, hanger_message, shifts_beyond
from shm.values import (
    NAN,
    TENSION,
    Alert,
    Averaged,
    Change,
    Drift,
    Hanger,
    Limits,
    ResponsePoint,
    Summary,
)
from shm.values.bar_description import BarDescription, describe_bar
from shm.values.messages import Lead
from shm.values.rounding import rounded_percent
from shm.watch.control_chart import ControlChart

LATEST_TEST = "the latest test"
BASELINE_TESTS = "the tests of the baseline"
BASELINE_AND_CHANGE = "the baseline and the change since"
BASELINE_ALONE = "the baseline; the tests since do not show whether it changed"


@dataclass(frozen=True)
class LatestTest:
    """The latest test of a hanger, and the tension that it gives by itself."""

    name: str
    time: datetime
    tension: Averaged
    model: str = ""


@dataclass(frozen=True)
class PeriodSummary:
    """Tests and alerts of a hanger within the period of a report.

    `change` is that of the tension from the first test of the period to the last, as a fraction;
    None where it has fewer than two.
    """

    tests: int = 0
    alerts: int = 0
    change: Interval | None = None


@dataclass(frozen=True)
class HangerSummary:
    """Everything that is shown of a hanger, whatever shows it.

    `latest` is None before the first test, `baseline` where no baseline is in force; `is_first`:
    the latest test is one of the baseline's. `drifts` are those of the latest test from the
    baseline, `called` the changes detected since that still hold, `detected` says in words what
    was ever detected since. `standing` are the alerts whose condition has not ended, the oldest
    first, `open_alerts` how many nobody took note of; `notes` say what people did about them.
    `unwatched` says that nothing has looked at the hanger for too long; `undated` names the tests
    dated by their receipt; `sensors` are those of the latest test, or those that stay. `course`
    is None without a period; `control` is the chart of a control hanger, None of any other.
    `diagnosed` is the line of a gap diagnosis that no change has outdated. `tests` counts the
    stored ones, also those without a result yet.
    """

    hanger: Hanger
    latest: LatestTest | None = None
    baseline: Averaged | None = None
    is_first: bool = False
    drifts: Sequence[Drift] = ()
    called: Sequence[Change] = ()
    detected: str = ""
    standing: Sequence[Alert] = ()
    open_alerts: int = 0
    warnings: Sequence[str] = ()
    notes: tuple[str, ...] = ()
    unwatched: Lead | None = None
    undated: Sequence[str] = ()
    sensors: tuple[ResponsePoint, ...] = ()
    course: PeriodSummary | None = None
    control: ControlChart | None = None
    diagnosed: str = ""
    tests: int = 0

    @cached_property
    def message(self) -> HangerMessage:
        """Return the state in a word and in two sentences, and all doubts."""
        return hanger_message(self)

    @property
    def status(self) -> Status | None:
        return self.message.status

    @property
    def bar(self) -> BarDescription:
        """Return the bar as its owner describes it, with these sensors."""
        return describe_bar(self.hanger, self.sensors)

    @cached_property
    def drift(self) -> Drift | None:
        """Return the drift of the tension; None where nothing was compared.

        What a standing alert says to be beyond its threshold stays what its message says.
        """
        stated = [each for each in shifts_beyond(self) if each.quantity == TENSION]
        of_test = [each for each in self.drifts if each.quantity == TENSION]
        return max(stated, key=lambda each: abs(each.shift_mean), default=None) or next(
            iter(of_test), None
        )

    @property
    def is_found(self) -> bool:
        """Return True if a shift was detected, not one that is given in case there is one."""
        return bool(self.called) or bool(shifts_beyond(self))

    @property
    def change(self) -> Interval | None:
        """Return the relative change of the tension since the baseline; None: not known.

        As the watch estimates it, at equal temperature; of a test that it has not compared, from
        two independent estimates.
        """
        if self.latest is None or self.baseline is None or self.is_baseline:
            return None
        if (drift := self.drift) is None:
            of_test = Interval.of_averaged(self.latest.tension)
            return of_test.since(Interval.of_averaged(self.baseline))
        is_known = math.isfinite(drift.shift_mean + drift.shift_sd)
        return Interval.normal(drift.shift_mean, drift.shift_sd) if is_known else None

    @property
    def is_baseline(self) -> bool:
        """Return True if the latest test is of the baseline itself."""
        return self.is_first and self.drift is None

    @property
    def _follows_change(self) -> bool:
        """Return True if the tests since the baseline show where the tension is now."""
        change = self.change
        if change is None:
            return False
        limit = self.hanger.thresholds.tension_shift_fraction
        return self.is_found or self.drift is None or change.width / 2 <= limit

    @cached_property
    def tension(self) -> Averaged | None:
        """Return the best estimate since the last change, absolute, over all model classes.

        It is the baseline's tension, moved by the change since: both intervals go into its own.
        Where the tests since do not show a change, it is the baseline's. Before there is a
        baseline, and where the watch has not compared the latest test, it is that test's. Its
        caveats are those of what it rests on; the repeatability is always the latest test's.
        """
        if self.latest is None or self.baseline is None:
            return self.latest.tension if self.latest else None
        of_test, drift = self.latest.tension, self.drift
        if drift is None and not self.is_baseline:
            return of_test
        known = replace(self.baseline, repeatability_sd_n=of_test.repeatability_sd_n)
        if drift is None or not self._follows_change:
            return known
        caveats = tuple(dict.fromkeys((*known.caveats, *of_test.faults)))
        moved = _moved(known.tension_n, drift.shift_mean, drift.shift_sd)
        above, slack = _beyond_limits(moved, self.hanger.limits)
        return replace(
            known,
            tension_n=moved,
            probability_above_limit=above,
            probability_slack=slack,
            caveats=caveats,
        )

    @property
    def caveats_of_latest(self) -> tuple[str, ...]:
        """Return the caveats of the latest test by itself that the shown tension does not have."""
        if self.latest is None or self.tension is None:
            return ()
        return tuple(x for x in self.latest.tension.caveats if x not in self.tension.caveats)

    @property
    def doubted(self) -> Averaged | None:
        """Return the tension that is at fault: the one that is shown, else the latest test's."""
        both = (self.tension, self.latest.tension if self.latest else None)
        return next((each for each in both if each and each.faults), None)

    @property
    def tension_n(self) -> Interval | None:
        return Interval.of_averaged(self.tension) if self.tension else None

    @property
    def baseline_n(self) -> Interval | None:
        return Interval.of_averaged(self.baseline) if self.baseline else None

    @property
    def basis(self) -> str:
        """Return what the tension rests on, in words; empty before the first test."""
        if self.latest is None:
            return ""
        if self.baseline is None or (self.drift is None and not self.is_baseline):
            return LATEST_TEST
        if self.is_baseline:
            return BASELINE_TESTS
        return BASELINE_AND_CHANGE if self._follows_change else BASELINE_ALONE

    @property
    def is_determined(self) -> bool:
        """Return False if the interval of the tension is wider than half the tension."""
        return self.tension_n is not None and not self.tension_n.is_wide

    @property
    def of_nominal(self) -> Interval | None:
        """Return the tension in percent of the nominal one; None where the hanger has none."""
        nominal_n = self.hanger.nominal_tension_n
        return self.tension_n.scaled(100 / nominal_n) if self.tension_n and nominal_n > 0 else None

    @property
    def of_nominal_words(self) -> str:
        """Return it as every face shows it; empty before the first test."""
        fraction = self.of_nominal
        if fraction is None:
            return "" if self.tension_n is None else "no nominal"
        if not self.is_determined:
            return "not determined"
        return rounded_percent(fraction.mean / 100, fraction.width / 200)

    @property
    def document(self) -> dict[str, Any]:
        """Return what `shm status` and the report of a bridge give of a hanger in JSON."""
        return {**self.message.document, **self.numbers}

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the numbers that every JSON document gives of a hanger.

        `averaged` is the headline, `change` a fraction with its 90 % interval, `by_latest_test`
        the tension that the latest test gives by itself.
        """
        change, latest = self.change, self.latest
        return {
            "averaged": averaged_document(self.tension) if self.tension else None,
            "basis": self.basis,
            "change": {k: v for k, v in asdict(change).items() if v is not None}
            if change
            else None,
            "by_latest_test": averaged_document(latest.tension) if latest else None,
        }


def _moved(base: Summary, shift: float, sd: float) -> Summary:
    """Return a tension after a shift with a standard deviation `sd`, both of the tension."""
    ratio, of_shift = 1 + shift, NORMAL_90 * sd * base.mean
    mean, middle = base.mean * ratio, base.q50 * ratio
    below, above = (math.hypot((end - base.mean) * ratio, of_shift) for end in (base.q05, base.q95))
    spread = math.hypot(base.sd * ratio, sd * base.mean)
    return Summary(mean, spread, mean - below, middle, mean + above)


def _beyond_limits(tension: Summary, limits: Limits) -> tuple[float, float]:
    """Return the probabilities of a tension above and below its limits; NaN without a limit."""
    above, slack = limits.tension_max_n, limits.tension_min_n
    return (
        _normal((tension.mean - above) / tension.sd) if math.isfinite(above) else NAN,
        _normal((slack - tension.mean) / tension.sd) if math.isfinite(slack) else NAN,
    )


def _normal(deviations: float) -> float:
    """Return the probability of a standard normal value below so many standard deviations."""
    return math.erfc(-deviations / math.sqrt(2)) / 2
