"""The tables of the trial."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from shm_cli.common import markdown
from tests.benchmarks.drift.comparing import (
    ASKED_YEARS,
    FalseAlarms,
    delays,
    false_alarms,
    limits_at,
    limits_for,
    of_scenario,
    verdicts,
)
from tests.benchmarks.drift.outcomes import BEYOND, OURS, RIVALS, VERDICTS, Outcome
from tests.benchmarks.drift.scenarios import HARD_QUIET, QUIET, SCENARIOS, Scenario

RULES = (OURS, *RIVALS)
FALSE_ALARMS, DELAYS = "drift_trial/false_alarms.csv", "drift_trial/delays.csv"
DELAYS_AS_ASKED = f"drift_trial/delays_at_one_alarm_in_{ASKED_YEARS:g}_years.csv"
"""Tables of all rules, beside the page."""


def fragment(outcomes: Sequence[Outcome], limit_years: float, years: float) -> str:
    """The marks and verdicts for people; `tables_beside` has the other rules in full."""
    same, asked = limits_at(outcomes, limit_years), limits_for(outcomes, 1 / ASKED_YEARS)
    parts = [
        said(outcomes, years),
        markdown(("mark", "found", "met"), mark_rows(outcomes, limit_years, same)),
        f"Every rule: [false alarms, and limits that give it our rate]({FALSE_ALARMS}); "
        f"[delays in tests at these limits]({DELAYS}), median and 90 % quantile; "
        f"[the same delays]({DELAYS_AS_ASKED}), ours too, at one false alarm in {ASKED_YEARS:g} "
        f"hanger-years ({', '.join(f'{rule} {limit:.3g}' for rule, limit in asked.items())}).",
        "What our first alarm after the change named:",
        markdown(("scenario", "alarms", *VERDICTS), verdict_rows(outcomes, limit_years)),
    ]
    return "\n\n".join(parts)


def tables_beside(
    outcomes: Sequence[Outcome], limit_years: float, probability: float
) -> dict[str, list[Sequence[str]]]:
    """All rules by file name; `probability` is the level of the rule on thresholds."""
    same, asked = limits_at(outcomes, limit_years), limits_for(outcomes, 1 / ASKED_YEARS)
    head = ("scenario", *RULES)
    return {
        FALSE_ALARMS: [FALSE_HEAD, *false_rows(outcomes, same, probability)],
        DELAYS: [head, *delay_rows(outcomes, same)],
        DELAYS_AS_ASKED: [head, *delay_rows(outcomes, asked)],
    }


def said(outcomes: Sequence[Outcome], years: float) -> str:
    seeds = sorted({each.seed for each in outcomes})
    own = [each.seconds / len(each.days) for each in outcomes]
    tests = np.mean([len(each.days) for each in outcomes])
    return (
        f"{len(seeds)} hangers, seeds {seeds[0]} to {seeds[-1]}, {years:g} years each, "
        f"{tests:.0f} tests in the mean; the sequential test costs "
        f"{1e3 * np.median(own):.1f} ms a test in the median."
    )


Mark = tuple[str, str, bool]


def marks(
    outcomes: Sequence[Outcome], limit_years: float, limits: Mapping[str, float]
) -> list[Mark]:
    """What is asked, what was found, whether it is met."""
    found: list[Mark] = []
    for scenario in (QUIET, HARD_QUIET):
        own = of_scenario(outcomes, scenario.name)
        if own:
            count = false_alarms(own, OURS, limit_years)
            mark = f"{scenario.title}: at most one false alarm in {ASKED_YEARS:g} hanger-years"
            found.append((mark, rate_said(count), count.rate <= 1 / ASKED_YEARS))
    for scenario in changing(outcomes):
        own = of_scenario(outcomes, scenario.name)
        median, late = (
            {rule: delays(own, rule, limits[rule]).quantile(share) for rule in RULES}
            for share in (0.5, 0.9)
        )
        best = min(RIVALS, key=lambda rule: (median[rule], late[rule]))
        mark = f"{scenario.title}: sooner than the best rival, median and 90 %"
        told = f"{tests_said(median[OURS])}, {tests_said(late[OURS])}; {best}: "
        told += f"{tests_said(median[best])}, {tests_said(late[best])}"
        sooner = all(each[OURS] <= min(each[rule] for rule in RIVALS) for each in (median, late))
        found.append((mark, told, sooner))
    return found


def mark_rows(
    outcomes: Sequence[Outcome], limit_years: float, limits: Mapping[str, float]
) -> list[tuple[str, str, str]]:
    return [
        (mark, told, "yes" if met else "no")
        for mark, told, met in marks(outcomes, limit_years, limits)
    ]


FALSE_HEAD = ("rule", "limit", QUIET.title, HARD_QUIET.title)


def false_rows(
    outcomes: Sequence[Outcome], limits: Mapping[str, float], probability: float
) -> list[tuple[str, ...]]:
    """A line for each rule; a dash where a scenario was not run."""
    rows = []
    for rule, limit in {**limits, BEYOND: probability}.items():
        cells = []
        for scenario in (QUIET, HARD_QUIET):
            own = of_scenario(outcomes, scenario.name)
            cells.append(rate_said(false_alarms(own, rule, limit)) if own else "-")
        rows.append((rule, f"{limit:.3g}", *cells))
    return rows


def rate_said(found: FalseAlarms) -> str:
    low, high = found.interval
    return (
        f"{found.count} in {found.years:.0f} years: {found.rate:.4f} a year "
        f"({low:.4f} to {high:.4f})"
    )


def changing(outcomes: Sequence[Outcome]) -> list[Scenario]:
    """The scenarios with a change that were run, in their order."""
    run = {each.scenario for each in outcomes}
    return [each for each in SCENARIOS.values() if each.changes and each.name in run]


def delay_rows(outcomes: Sequence[Outcome], limits: Mapping[str, float]) -> list[tuple[str, ...]]:
    """A line for each scenario: median, 90 % quantile, share never detected, spoilt."""
    rows = []
    for scenario in changing(outcomes):
        own = of_scenario(outcomes, scenario.name)
        rows.append((scenario.title, *(delay_said(own, rule, limits[rule]) for rule in RULES)))
    return rows


def delay_said(outcomes: Sequence[Outcome], rule: str, limit: float) -> str:
    found = delays(outcomes, rule, limit)
    never = sum(map(math.isinf, found.tests))
    told = f"{tests_said(found.quantile(0.5))}, {tests_said(found.quantile(0.9))}"
    told += f"; {never} of {len(found.tests)} never" if never else ""
    return told + (f"; {found.spoilt} alarmed before" if found.spoilt else "")


def tests_said(tests: float) -> str:
    if math.isnan(tests):
        return "-"
    return "never" if math.isinf(tests) else f"{tests:.0f}"


def verdict_rows(outcomes: Sequence[Outcome], limit_years: float) -> list[tuple[str, ...]]:
    rows = []
    for scenario in changing(outcomes):
        found = verdicts(of_scenario(outcomes, scenario.name), limit_years)
        total = sum(found.values())
        shares = [f"{found.get(kind, 0) / total:.2f}" if total else "-" for kind in VERDICTS]
        rows.append((scenario.title, str(total), *shares))
    return rows
