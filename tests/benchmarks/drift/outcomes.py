"""What the rules said in the simulated years of one hanger, and how it reads against the truth."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

from shm.values import TENSION
from tests.benchmarks.drift.climate import DAYS_A_YEAR

OURS, BEYOND = "ours", "beyond the threshold"
THREE_SIGMA, CUSUM = "3 sigma", "CUSUM"
CUSUM_WARM, CUSUM_CLIPPED = "CUSUM, temperature", "CUSUM, temperature, clipped"
RIVALS = (THREE_SIGMA, CUSUM, CUSUM_WARM, CUSUM_CLIPPED)

RIGHT, OPEN, WRONG_END, WRONG = "right", "cannot tell", "wrong end", "wrong"
VERDICTS = (RIGHT, OPEN, WRONG_END, WRONG)


@dataclass(frozen=True)
class Outcome:
    """One scenario of one hanger.

    `days` (tests,) since the beginning; `changed_at` is the index of the first test after the
    change, None without one. `statistics` by rule (tests,): a rule alarms where its own is beyond
    its limit. `named` (tests,) is what the watch held to have moved, the likeliest first, then what
    moved with it and what the data cannot tell from it. `plane_of` gives the plane of each spring;
    `truth` the springs that gave way, or the tension.
    """

    seed: int
    scenario: str
    days: tuple[float, ...]
    changed_at: int | None
    statistics: Mapping[str, tuple[float, ...]]
    named: tuple[tuple[str, ...], ...]
    truth: tuple[str, ...]
    plane_of: Mapping[str, str | None] = field(default_factory=dict)
    seconds: float = 0.0

    def first_alarm(self, rule: str, limit: float) -> int | None:
        """The index of the first test at which a rule alarms."""
        return next((n for n, value in enumerate(self.statistics[rule]) if value > limit), None)

    def quiet_years(self, rule: str, limit: float) -> tuple[int, float]:
        """False alarms, 0 or 1, and the years until then or until the change or the end."""
        alarm, last = self.first_alarm(rule, limit), len(self.days) - 1
        end = last if self.changed_at is None else self.changed_at - 1
        false = alarm is not None and alarm <= end
        stop = alarm if false and alarm is not None else end
        return int(false), self.days[stop] / DAYS_A_YEAR

    def delay(self, rule: str, limit: float) -> float:
        """Tests from the change to the alarm, the first one after it is 1; infinite for never.

        NaN where the rule alarmed before the change, or nothing changed.
        """
        alarm = self.first_alarm(rule, limit)
        if self.changed_at is None or (alarm is not None and alarm < self.changed_at):
            return math.nan
        return math.inf if alarm is None else alarm - self.changed_at + 1.0

    def verdict(self, limit: float) -> str:
        """Whether the watch named the right quantity in its first alarm after the change."""
        alarm = self.first_alarm(OURS, limit)
        if alarm is None or self.changed_at is None or alarm < self.changed_at:
            return ""
        return verdict(self.named[alarm], self.truth, self.plane_of)


def verdict(
    named: tuple[str, ...], truth: tuple[str, ...], plane_of: Mapping[str, str | None]
) -> str:
    """How what was named, with what is alike, stands to the truth.

    An end that is left open counts as right: the frequencies of a uniform bar do not tell it. Where
    springs of both planes gave way, those of one are right too.
    """
    planes, true_planes = ({plane_of.get(name) for name in names} for names in (named, truth))
    if not set(named) & set(truth):
        of_the_ends = TENSION not in (*named, *truth)
        return WRONG_END if of_the_ends and planes <= true_planes else WRONG
    if TENSION in named:
        return RIGHT if len(named) == 1 else OPEN
    return RIGHT if planes <= true_planes else OPEN


def written(outcome: Outcome) -> str:
    """As a line of the answers."""
    return json.dumps(asdict(outcome))


def read(line: str) -> Outcome:
    """From a line of the answers."""
    fields = json.loads(line)
    for name in ("days", "truth"):
        fields[name] = tuple(fields[name])
    fields["named"] = tuple(tuple(each) for each in fields["named"])
    fields["statistics"] = {rule: tuple(each) for rule, each in fields["statistics"].items()}
    return Outcome(**fields)
