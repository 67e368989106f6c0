"""The gap diagnosis without each of its mechanisms, on hangers that others wrote.

python tests/benchmarks/gap_ablation.py --hangers 24 --seed 41
python tests/benchmarks/gap_ablation.py --only "no lobes" "no mirrored places"

The hangers are those of a blind trial with that seed (`blind_trial.py`), the truth in hand. Each
row leaves out one mechanism: how many answers are right, how many causes are named first and in
their group, how many answers are sure and wrong, how many sound hangers have a gap, how many
intervals hold the tension, the median error of the tension after, failed samplers, and seconds. A
mechanism that changes none of these is to be left out. Half a minute a row and hanger, at most.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from shm.gap.causes import baseline, outliers, search
from shm.gap.causes.probabilities import ByLaws
from shm.gap.hypotheses import noise, observations, problem, sampling
from shm.values import Outcome
from shm.values.posterior import ENOUGH_EFFECTIVE
from tests.benchmarks.blind_scores import SURE, Row
from tests.benchmarks.blind_trial import diagnose_hanger, make_hanger, plan_hangers
from tests.benchmarks.left_out import Change, without

diagnosing = import_module("shm.gap.diagnose")  # the package has a function of that name


def one_peak(lobes: Any, target: Any, peaks: Sequence[Any]) -> None:
    """Make lobes of which the best peak is the only one."""
    lobes.peaks = list(peaks[:1])
    lobes._normals = [sampling._normal_of(peaks[0], target.other)]
    lobes._log = np.array([peaks[0].log_evidence])


def unchanged(observations: Any) -> Any:
    """Return standard deviations as they are stated."""
    return observations.sd


def _hold_laws(of: Any, before: Any, fit: Any, rng: Any) -> Any:
    return ByLaws(0.0, 0.0, fit.draws)


def _group_near(causes: Sequence[Any], near: Sequence[bool]) -> tuple[tuple[int, ...], ...]:
    members = tuple(int(i) for i in np.flatnonzero(near))
    return (members,) if len(members) > 1 else ()


VARIANTS: dict[str, Sequence[Change]] = {
    "whole": [],
    "whole, other seed": [],
    "no lobes": [(sampling.Lobes, "__init__", one_peak)],
    "no draws of an update": [(search, "_with_draws_of_update", lambda _, fit, rng: fit)],
    "no proposals without the effect": [(sampling, "_HOW", replace(sampling._HOW, without=1e-9))],
    "only exact linear terms": [(problem.GapProblem, "settle", lambda of, peak: None)],
    "stated errors not drawn together": [(noise, "drawn_together", unchanged)],
    "planes' errors never alike": [
        (noise, "_correlations", lambda of: [(np.eye(of.design.frequencies), 1.0)])
    ],
    "shapes as certain as stated": [(noise, "_factors_of_shapes", lambda of: [(1.0, 1.0)])],
    "planes never turn": [
        (observations, "turn_of_axes", lambda test, hanger: np.zeros((len(test.modes), 3)))
    ],
    "remainders over orders alone": [(noise, "_patterns", noise._over_orders)],
    "no mirrored places": [(search.Search, "_with_mirrored", lambda of, target, peaks: peaks)],
    "exact thermometers": [
        (problem.GapProblem, "settle_temperatures", lambda of, hypothesis, z: False)
    ],
    "no richer class afterwards": [(diagnosing, "find_richer", lambda of, hypothesis: None)],
    "no gross errors": [(outliers, "_find_gross_error", lambda found: None)],
    "laws hold": [(search, "allow_for_laws", _hold_laws)],
    "groups by evidence alone": [(search, "group", _group_near)],
    "idle pairs in groups": [(search, "_idle", lambda pair, alone: False)],
    "baseline is the likeliest class alone": [(baseline, "_OF_NOTE", 0.999)],
    "Laplace's method alone": [(search.Search, "sample_probable", lambda of, chance: None)],
}


def describe(name: str, rows: Sequence[Row]) -> str:
    """Return the table's row of one variant."""
    done = [row for row in rows if row.diagnosis is not None]
    asked = [row for row in done if row.truth["accepted"] and not row.in_class]
    sound = [row for row in done if row.is_sound]
    errors = [abs(row.error("after")) for row in done]
    seconds = [float(row.answer["processor_s"]) for row in rows]
    found = [row.diagnosis for row in done if row.diagnosis is not None]
    failed = sum(each.effective_draws < ENOUGH_EFFECTIVE for each in found)
    cells = (
        f"{sum(row.is_right for row in done)} of {len(rows)}",
        f"{sum(bool(row.first & set(row.truth['accepted'])) for row in asked)} of {len(asked)}",
        f"{sum(bool(row.named & set(row.truth['accepted'])) for row in asked)}",
        f"{sum(row.is_false_cause and row.probability > SURE for row in done)}",
        f"{sum(row.outcome is not Outcome.NO_GAP for row in sound)} of {len(sound)}",
        f"{sum(row.holds for row in done)}",
        f"{np.median(errors):.2%}",
        f"{failed}",
        f"{np.median(seconds):.1f}, {max(seconds):.0f}",
    )
    return f"| {name} | " + " | ".join(cells) + " |"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hangers", type=int, default=24)
    parser.add_argument("--seed", type=int, default=41)
    parser.add_argument("--only", nargs="*", default=list(VARIANTS), choices=list(VARIANTS))
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        plans = plan_hangers(given.hangers, given.seed)
        truths = [make_hanger(plan, given.seed, Path(folder) / plan.name) for plan in plans]
        print(
            "| left out | right | first | in group | sure and wrong | gaps of sound | holds "
            "| error | failed | s |"
        )
        print("|---|---|---|---|---|---|---|---|---|---|", flush=True)
        for name in given.only:
            rows = []
            with without(VARIANTS[name]):
                for plan, truth in zip(plans, truths, strict=True):
                    seed = 2 if name == "whole, other seed" else 1
                    answer = diagnose_hanger(Path(folder) / plan.name, (), seed)
                    rows.append(Row(truth, answer))
            print(describe(name, rows), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
