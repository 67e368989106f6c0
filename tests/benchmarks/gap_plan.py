"""Does a planned measurement win the log odds that it promises, and does a plan need fewer tests?

    python tests/benchmarks/gap_plan.py --cases 14 --seed 202 [--causes a,b] [--keep FILE]

Simulated hangers with one cause of the catalogue, of 30 standard deviations in a full campaign,
first measured as the field does: eight frequencies of one plane. Each is then measured on, test
after test, by the plan (every test at one hour, planned anew after each) and by a fixed order,
until the true cause has 0.95 by the evidence, or five tests are made. The simulator shares no code
with the models. One process; a minute of a core a case. Asked: slope of won on promised log odds
0.8 to 1.2, and 30 % fewer tests than in the fixed order.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from shm.assumptions import DEFAULTS  # noqa: E402
from shm.gap.contract import Design, GapOptions  # noqa: E402
from shm.gap.experiment_design import Proposal  # noqa: E402
from shm.gap.measurement_plan import (  # noqa: E402
    ENOUGH,
    Race,
    _offered,
    explanations,
    holds,
    log_odds_of,
    planned,
)
from shm.gap.search import Attribution, attribute  # noqa: E402
from shm.models.effects import EFFECTS  # noqa: E402
from shm.simulate import HangerState, PlantedEffect  # noqa: E402
from shm.values import MEASUREMENT_HOURS, PLANES, FloatArray, Hanger, ModalTest  # noqa: E402
from tests.helpers.gap_campaigns import problem_of  # noqa: E402
from tests.worlds.simulated.campaign import (  # noqa: E402
    CampaignPlan,
    _realised,
    identified,
)
from tests.worlds.simulated.detectable import at_share, scaled_to, size_of  # noqa: E402
from tests.worlds.simulated.effects.registry import choices, drawn  # noqa: E402
from tests.worlds.simulated.reality import (  # noqa: E402
    Reality,
    sd_factors,
)

CAUSES = (
    "rotational_end_flexibility", "effective_length", "bending_stiffness", "distributed_mass",
    "point_mass", "stiff_end_zones", "section_size", "joint_softening",
)  # fmt: skip
"""The catalogue of the trial: causes in the hanger that one plane's frequencies hardly separate."""
FIXED = ("other plane", "known mass", "sensors", "temperature", "level", "more modes", "repeat")
SIZE, REFERENCE_C, MOST = 30.0, 10.0, 5
REALITY = Reality(own_laws=False)
ONE_PLANE = CampaignPlan(PLANES[:1], shapes=False, reality=REALITY)
FULL = CampaignPlan(reality=REALITY)
ROD = Hanger(
    id=3,
    length_m=12.0,
    elastic_modulus_pa=200e9,
    area_m2=np.pi * 0.130**2 / 4,
    second_moment_m4=np.pi * 0.130**4 / 64,
    mass_per_length_kg_m=7800 * np.pi * 0.130**2 / 4,
    nominal_tension_n=711e3,
    diameter_m=0.130,
)
DRAWS_OF_A_CASE, ABOUT, WEAK = 12, 1.02, (0.02, 0.2)


def plant_to_size(cause: str, state: HangerState, rng: np.random.Generator) -> PlantedEffect | None:
    """Draw an effect of the size in a full campaign; None where it never is so large.

    Where its weakest is larger everywhere, it is drawn from the weak end of its range, but not from
    the very end, which no interval could hold.
    """
    places = choices(cause, FULL.places_m(ROD), [test.id for test in FULL.tests(ROD)])
    weak = None
    for _ in range(DRAWS_OF_A_CASE):
        effect = drawn(cause, str(rng.choice(places)), ROD, rng)
        scaled = scaled_to(SIZE, ROD, state, effect, FULL)
        if scaled is not None and size_of(ROD, state, [scaled], FULL) < ABOUT * SIZE:
            return scaled
        if scaled is not None and weak is None:
            weak = at_share(float(rng.uniform(*WEAK)), ROD, effect)
    return weak


@dataclass(frozen=True)
class OneTest(CampaignPlan):
    """One test, and a twin that holds the mean temperature at the reference."""

    test: ModalTest = field(
        default_factory=lambda: ModalTest("t1", (), None, None, REFERENCE_C, 1.0)
    )

    def tests(self, hanger: Hanger) -> tuple[ModalTest, ...]:
        twin = replace(
            self.test, id="twin", temperature_c=2 * REFERENCE_C - self.test.temperature_c
        )
        return (self.test, twin)


@dataclass(frozen=True)
class Bridge:
    """A hanger with its cause, to be measured as often as one likes."""

    planted: PlantedEffect
    seed: int

    def test(self, plan: OneTest) -> tuple[ModalTest, float]:
        """One test by a plan, and the tension."""
        state = HangerState(ROD.nominal_tension_n)
        made = np.random.default_rng((self.seed, 1))
        truth, exact = _realised(ROD, state, [self.planted], plan, made)
        noise = np.random.default_rng((self.seed, 2, int(plan.test.id[1:])))
        factors = sd_factors(ROD, state, plan)
        modes = identified(exact[0], factors, ROD, plan, noise)
        return replace(plan.test, modes=modes), truth.tension_n


@dataclass(frozen=True)
class Known:
    """What is known of a hanger after some tests."""

    hanger: Hanger
    tests: tuple[ModalTest, ...]
    causes: tuple[str, ...] = CAUSES

    def attribution(self, seed: int) -> Attribution:
        problem = problem_of(self.tests, self.hanger)
        without = tuple(name for name in EFFECTS if name not in self.causes)
        return attribute(
            problem, GapOptions(without=without, seed=seed), np.random.default_rng(seed)
        )

    def after(self, proposal: Proposal, bridge: Bridge) -> Known:
        """With the proposed measurement made."""
        plan = plan_of(proposal.design, self.tests)
        test, tension_n = bridge.test(plan)
        wanted = set(
            zip(proposal.design.frequency_plane, proposal.design.frequency_order, strict=True)
        )
        kept = [m for m in test.modes if (PLANES.index(m.plane), m.order) in wanted]
        tests = (*self.tests, replace(test, modes=tuple(kept)))
        if proposal.kind != "lift-off":
            return replace(self, tests=tests)
        error = np.random.default_rng((bridge.seed, 3)).standard_normal()
        read_n = tension_n * (1 + DEFAULTS.tension_reading_sd.value * error)
        scatter = replace(self.hanger.scatter, tension=DEFAULTS.tension_reading_sd.value)
        weighed = replace(self.hanger, nominal_tension_n=read_n, scatter=scatter)
        return replace(self, hanger=weighed, tests=tests)


def chance_of(cause: str, found: Attribution) -> float:
    """Return the probability of all explanations that name a cause."""
    return sum(each.probability for each in explanations(found) if holds(each.name, cause))


def plan_of(design: Design, before: tuple[ModalTest, ...]) -> OneTest:
    """How the simulator makes the one test of a design."""
    (conditions,) = design.conditions
    mean_c = float(np.mean([test.temperature_c for test in before]))
    places = tuple(design.places_m[k] for k in np.unique(design.shape_place))
    test = ModalTest(
        f"t{len(before) + 1}",
        (),
        ROD.id,
        None,
        mean_c + conditions.temperature_shift_k,
        conditions.amplitude,
        conditions.added_mass,
    )
    return OneTest(
        planes=tuple(PLANES[k] for k in np.unique(design.frequency_plane)),
        modes=int(design.frequency_order.max()),
        sensors_x_m=places,
        shapes=bool(places),
        reality=REALITY,
        test=test,
    )


def tried(index: int, seed: int, causes: tuple[str, ...]) -> dict[str, Any] | None:
    """One hanger by the plan and in the fixed order."""
    cause = causes[index % len(causes)]
    own = 1000 * seed + index
    rng = np.random.default_rng((own, 0))
    effect = plant_to_size(cause, HangerState(ROD.nominal_tension_n), rng)
    if effect is None:
        return None
    bridge, started = Bridge(effect, own), time.process_time()
    first, _ = bridge.test(OneTest(PLANES[:1], shapes=False, reality=REALITY))
    known = Known(ROD, (first,), causes)
    start = known.attribution(own)
    found = {
        "cause": cause,
        "at": effect.at,
        "start": chance_of(cause, start),
        "planned": walked(known, start, bridge, by_plan),
        "fixed": walked(known, start, bridge, in_order),
    }
    return found | {"seconds": time.process_time() - started}


def walked(known: Known, now: Attribution, bridge: Bridge, chosen: Any) -> list[dict[str, Any]]:
    """Test after test, with what was promised and what the true cause won."""
    steps: list[dict[str, Any]] = []
    cause = bridge.planted.name
    while chance_of(cause, now) < ENOUGH and len(steps) < MOST:
        proposal, promised = chosen(now, len(steps), bridge.seed)
        if proposal is None:
            break
        before = chance_of(cause, now)
        known = known.after(proposal, bridge)
        now = known.attribution(bridge.seed)
        after = chance_of(cause, now)
        won = float(log_odds_of(after) - log_odds_of(before))
        steps.append(
            {
                "kind": proposal.kind,
                "promised": promised,
                "won": won,
                "before": before,
                "after": after,
            }
        )
    return steps


def by_plan(now: Attribution, step: int, seed: int) -> tuple[Proposal | None, float]:
    """The first step of a plan; once it has none, the fixed order."""
    race = Race.of(now, np.random.default_rng((seed, 4, step)))
    steps = planned(race, dict.fromkeys(MEASUREMENT_HOURS, 1.0))
    if not steps:
        return in_order(now, step, seed)
    return next(e for e in race.offered if e.what == steps[0].what), steps[0].promised_log_odds


def in_order(now: Attribution, step: int, seed: int) -> tuple[Proposal | None, float]:
    """The first kind of the fixed order that was not made yet."""
    fits = [now.baseline, *(each.best.fit for each in now.explanations if each.best.fit)]
    offered, *_ = _offered(now.search.problem, fits[:2])
    able = [each for kind in FIXED for each in offered if each.kind == kind]
    return (able[0], float("nan")) if able else (None, float("nan"))


def told(rows: list[dict[str, Any]]) -> str:
    """Slope of won on promised, and the numbers of tests, with intervals over hangers."""
    rng = np.random.default_rng(1)
    counts = np.array([[_tests(row[arm]) for arm in ("planned", "fixed")] for row in rows])
    pairs = [
        np.array([(s["promised"], s["won"]) for s in row["planned"] if np.isfinite(s["promised"])])
        for row in rows
    ]
    pairs = [each.reshape(-1, 2) for each in pairs]
    drawn = [rng.integers(len(rows), size=len(rows)) for _ in range(2000)]
    slopes = [_slope(np.concatenate([pairs[k] for k in own])) for own in drawn]
    fewer = [1 - counts[own, 0].mean() / counts[own, 1].mean() for own in drawn]
    reached = [np.mean([_reached(row[arm], row) for row in rows]) for arm in ("planned", "fixed")]
    every = np.concatenate(pairs)
    return (
        f"{len(rows)} hangers, {len(every)} planned steps\n"
        f"won on promised: slope {_slope(every):.2f} ({_range(slopes)}), mean promised "
        f"{every[:, 0].mean():.2f}, won {every[:, 1].mean():.2f}\n"
        f"tests to 0.95: {counts[:, 0].mean():.2f} planned, {counts[:, 1].mean():.2f} in the fixed "
        f"order; fewer by {1 - counts[:, 0].mean() / counts[:, 1].mean():.2f} ({_range(fewer)})\n"
        f"reached: {reached[0]:.2f} planned, {reached[1]:.2f} fixed"
    )


def _tests(steps: list[dict[str, Any]]) -> int:
    """Where the cause was not reached, one more than the most."""
    return len(steps) if not steps or steps[-1]["after"] >= ENOUGH else MOST + 1


def _reached(steps: list[dict[str, Any]], row: dict[str, Any]) -> bool:
    return bool((steps[-1]["after"] if steps else row["start"]) >= ENOUGH)


def _slope(pairs: FloatArray) -> float:
    """Through the origin: no promise, nothing won."""
    promised, won = pairs.T
    return float(promised @ won / (promised @ promised))


def _range(values: list[float]) -> str:
    low, high = np.quantile(values, [0.025, 0.975])
    return f"{low:.2f} to {high:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=24)
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--causes", default=",".join(CAUSES))
    parser.add_argument("--keep", type=Path)
    asked = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for index in range(asked.cases):
        row = tried(index, asked.seed, tuple(asked.causes.split(",")))
        if row is None:
            continue
        rows.append(row)
        print(json.dumps(row), flush=True)
        if asked.keep:
            asked.keep.write_text(json.dumps(rows))
    print(told(rows))


if __name__ == "__main__":
    main()
