"""What the watch loses without each of its mechanisms: a new rule has to pass this table.

make ablation ROOM=watch
make ablation ROOM=watch ARGS="--only 'everything,persistence' --bridges 4 --seed 82000"
make ablation ROOM=watch ARGS="--histories"                 # a look, in minutes, before any season
python tests/benchmarks/watch_ablation.py --answers a.jsonl --of b.jsonl    # without what b has

Seasons of the worlds of `watch_worlds.py`: quiet ones, and events on day 540. For each mechanism
left out: first false alarms a hanger-year, notices a year, events reported of those there are, the
median test at which they are, how many first causes are right, how often the last shift's 90 %
interval holds the true one, and processor time. A mechanism that changes none of these is to go.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from shm.values import BaselineCheck
from shm.watch import state_sums, watcher, watching
from shm.watch.engine import causes, mistaken_modes, options, persistence, readings
from shm.watch.engine.change_point import Evidence
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.readings import Likelihood
from shm.watch.state_sums import StateSums, WatchState
from shm.watch.watcher import Watcher
from tests.benchmarks import watch_worlds
from tests.benchmarks.left_out import Change, without
from tests.benchmarks.watch_trial import outcomes
from tests.contracts import watch_calls
from tests.contracts.test_watch_contract import differ
from tests.contracts.watch_scenarios import SCENARIOS
from tests.helpers.synthetic_readings import watch_of

Row = dict[str, Any]


def give(value: Any) -> Callable[..., Any]:
    """Return a function that gives one value, whatever it is asked."""
    return lambda *_, **__: value


def with_options(**changed: Any) -> Change:
    """Return the change of some of the watch's options."""
    as_it_is = watching.options_of
    return watching, "options_of", lambda *given: replace(as_it_is(*given), **changed)


def with_limits(module: Any, **changed: Any) -> Change:
    """Return the change of some of the limits that a module reads."""
    return module, "LIMITS", replace(LIMITS, **changed)


def count_all(seen: Any, *_: Any) -> Any:
    """Count every test that has a mode."""
    return np.isfinite(seen.variances).any(axis=1)


def weigh_all(watcher: Watcher, state: WatchState) -> tuple[WatchState, Evidence]:
    """Give the newest visit its full weight."""
    rows = np.union1d(np.flatnonzero(state.counted), [state.tests - 1])
    return state, watcher._evidence(state, rows)


def find_no_pattern(*given: Any) -> Any:
    """Return no pattern of any quantity."""
    return tuple(np.zeros((0, len(given[3]))) for _ in given[4])


WHOLE = "everything"
MECHANISMS: Mapping[str, Sequence[Change]] = {
    WHOLE: (),
    "persistence": [
        (Watcher, "_apply_recurrence_bound", lambda _, state, found: (found, found, 0))
    ],
    "persistence: joints that give": [(persistence, "_SLIPPING", ())],
    "persistence: large changes": [with_limits(persistence, large_seem=LIMITS.seem)],
    "persistence: gross changes": [with_limits(persistence, gross=np.inf)],
    "persistence: odd tests differ": [with_limits(persistence, odd_alike=1.0)],
    "persistence: bounds of waiting": [
        with_limits(persistence, least_waited=0.0, most_waited=np.inf)
    ],
    "bound on one visit": [(Watcher, "_limit_last_visit", weigh_all)],
    "tests that stand alone": [(watcher, "select_consistent_tests", count_all)],
    "a baseline that stands alone": [(watcher, "ENOUGH_AGAINST", 10**9)],
    "two tests that agree": [(watch_worlds, "agreement", give(None))],
    "learnt scatter": [(StateSums, "scatter", lambda self, _: self.structure.scatter_variance)],
    "four scales of scatter": [with_options(scatter_scales=(1.0,))],
    "the likeliest scatter": [
        (Evidence, "log_evidence", property(lambda self: min(self.log_statistic, self.log_most)))
    ],
    "mistaken modes": [(readings.Reader, "_sound", lambda _, seen: np.ones(len(seen.own), bool))],
    "a start from slack": [
        (Likelihood, "far_start", lambda self, _: np.zeros(len(self._quantities)))
    ],
    "mistaken modes: loosened ends": [with_limits(readings, loosened=1e-300)],
    "mistaken modes: tests of another bar": [with_limits(mistaken_modes, misfit=1e-300)],
    "stated errors by the misfit": [with_limits(readings, prior_freedom=1e12)],
    "patterns of loosening": [(readings, "loosening_of", find_no_pattern)],
    "creep": [with_options(creep_per_year_sd=1e-9)],
    "unknown temperatures of a season": [(options, "_SEASON_YEARS", 1e-9)],
    "tests of one day": [(state_sums, "OF_ONE_VISIT_YEARS", 1e-9)],
    "springs that move together": [with_limits(causes, correlation=0.0)],
    "least shift of a frequency": [with_options(least_frequency_shift=0.0)],
    "check of the baseline": [(watch_worlds, "check_baseline", give(BaselineCheck()))],
}


def list_differences() -> tuple[list[str], list[str]]:
    """Return the golden histories that change, and the scenarios that are not met."""
    changed = [
        name
        for name in (*watch_calls.STATES, "deck")
        if list(differ(watch_calls.CASES[name](), watch_calls.golden(name)))
    ]
    unmet = []
    for each in SCENARIOS.values():
        found = watch_of(each.make(), each.quantities)
        first = found.calls[0].index if found.calls else None
        is_met = first is None if each.first is None else each.first <= (first or -1) <= each.last
        if not is_met or found.tests[-1].change.is_baseline_alone != each.is_baseline_doubted:
            unmet.append(each.name)
    return changed, unmet


HEADS = (
    "| left out | first false alarms a hanger-year | notices a hanger | reported | median test "
    "| cause right | shift in its interval | ms a test |"
)


def row_of(name: str, rows: Sequence[Row]) -> str:
    """Return the table's row of a mechanism."""
    quiet = [row for row in rows if row["scenario"] in outcomes.QUIET]
    events = [row for row in rows if row["scenario"] not in outcomes.QUIET]
    alarms, years = outcomes.false_alarms(quiet, outcomes.ours)
    notices = sum(not outcomes.is_alert(each) for row in rows for each in row["alerts"])
    waited = outcomes.delays(events, outcomes.ours)
    found = [row for row in events if outcomes.first_alert(row)]
    cells = [
        name,
        outcomes.rate(alarms, years) if years else "",
        f"{notices / max(len(rows), 1):.2f}",
        f"{int(np.isfinite(waited).sum())} of {len(waited)}",
        f"{np.median(waited):.0f}" if len(waited) else "",
        outcomes.share(sum(map(outcomes.is_right, found)), len(found)),
        outcomes.share(sum(map(outcomes.covers, rows)), len(rows)),
        f"{1000 * float(np.median([row['seconds'] for row in rows])):.0f}",
    ]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--world", default=",".join(watch_worlds.WORLDS))
    parser.add_argument("--scenarios", default="quiet,step5,springs,lamp")
    parser.add_argument("--bridges", type=int, default=2)
    parser.add_argument("--seed", type=int, default=82000)
    parser.add_argument("--years", type=float, default=3.0)
    parser.add_argument("--baselines", default="1")
    parser.add_argument("--begins", type=float, default=outcomes.BEGINS, help="day of the events")
    parser.add_argument("--only", help="these mechanisms, parted by commas")
    parser.add_argument("--histories", action="store_true", help="golden histories and scenarios")
    parser.add_argument("--answers", type=Path, help="keep every hanger's outcome, a line each")
    parser.add_argument("--of", type=Path, nargs="*", default=[], help="outcomes that are there")
    given = parser.parse_args()
    outcomes.BEGINS = watch_worlds.BEGINS = given.begins
    names = given.only.split(",") if given.only else list(MECHANISMS)
    if unknown := set(names) - MECHANISMS.keys():
        parser.error(f"no mechanism {sorted(unknown)}; there are {', '.join(MECHANISMS)}")
    if given.histories:
        for name in names:
            with without(MECHANISMS[name]):
                changed, unmet = list_differences()
            print(f"{name}: changed {changed}, not met {unmet}", flush=True)
        return
    rows = [json.loads(line) for path in given.of for line in path.read_text().splitlines()]
    key = ("without", "world", "scenario", "seed", "baseline")
    done = {tuple(row[each] for each in key) for row in rows}
    tasks = [
        (name, (world, scenario, seed, int(count), given.years))
        for name in names
        for count in given.baselines.split(",")
        for scenario in given.scenarios.split(",")
        for world in given.world.split(",")
        for seed in range(given.seed, given.seed + given.bridges)
        if (name, world, scenario, seed, int(count)) not in done
    ]
    for name, season in tasks:
        with without(MECHANISMS[name]):
            found = [{**row, "without": name} for row in watch_worlds.solved(season)]
        rows += found
        if given.answers:
            with given.answers.open("a") as file:
                file.writelines(json.dumps(row) + "\n" for row in found)
    print(HEADS, "|" + " --- |" * 8, sep="\n")
    for name in dict.fromkeys(row["without"] for row in rows):
        print(row_of(name, [row for row in rows if row["without"] == name]), flush=True)


if __name__ == "__main__":
    main()
