"""Cases of every richness: a hanger, what is planted in it, and what the diagnosis makes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import UsageError
from shm.gap.attribution import Attribution, attributed
from shm.gap.observations import observed
from shm.gap.options import GapOptions
from shm.gap.problem import GapProblem
from shm.simulate import (
    PLANTED,
    UNLISTED,
    Campaign,
    CampaignPlan,
    HangerState,
    PlantedEffect,
    Reality,
    at_share,
    campaign_with_truth,
    choices,
    drawn,
    scaled_to,
    size_of,
)
from shm.values import Hanger
from tests.benchmarks.gap.scores import Asked, Scored, scored

_ALL = CampaignPlan(reality=Reality())
_ONE_TEST = replace(_ALL, shapes=False, temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0)
PLANS = {
    "one plane": replace(_ONE_TEST, planes=("transverse",)),
    "two planes": _ONE_TEST,
    "known mass": replace(_ONE_TEST, mass_share=_ALL.mass_share),
    "shapes": replace(_ONE_TEST, shapes=True),
    "conditions": replace(_ALL, shapes=False, mass_share=0.0),
    "everything": _ALL,
}
SIZES, SIZES_OF_A_PAIR = (1.0, 64.0), (8.0, 40.0)
ON_SENSORS = "sensor_"
NONE, ONE, TWO = 0.25, 0.75, 0.875
DRAWS_OF_A_CASE = 6
ABOUT = 1.1
WEAK = 0.02, 0.2
YIELD_PA = 355e6


@dataclass(frozen=True, eq=False)
class Made:
    """A case: its hanger and tests, what was planted, and of what size all together."""

    asked: Asked
    kind: str
    hanger: Hanger
    effects: tuple[PlantedEffect, ...]
    size: float
    campaign: Campaign


def answered(asked: Asked) -> Scored | None:
    """A case made, diagnosed and scored; None where nothing of it can be seen."""
    case = made(asked)
    if case is None or (asked.left_out and case.kind not in ("one", "two")):
        return None
    problem = GapProblem(case.hanger, "beam1", observed(case.campaign.tests, case.hanger))
    return scored(asked, *truth(case), problem, diagnosed(case, problem))


def truth(case: Made) -> tuple[str, tuple[str, ...], float, float]:
    """Kind, effects, size and tension of a case."""
    names = tuple(each.name for each in case.effects)
    return case.kind, names, case.size, case.campaign.truth.tension_n


def diagnosed(case: Made, problem: GapProblem) -> Attribution:
    """Without its effects where they are left out."""
    without = tuple(each.name for each in case.effects) if case.asked.left_out else ()
    options = GapOptions(without=without, seed=case.asked.seed)
    return attributed(problem, options, np.random.default_rng(case.asked.seed))


def made(asked: Asked) -> Made | None:
    """What is planted does not depend on whether it is left out afterwards."""
    plan = PLANS[asked.richness]
    rng = np.random.default_rng([asked.seed, *asked.richness.encode()])
    hanger = rod(rng)
    state = HangerState(hanger.nominal_tension_n)
    chance = float(rng.uniform())
    kind = next(
        (kind for kind, up_to in (("none", NONE), ("one", ONE), ("two", TWO)) if chance < up_to),
        "unknown",
    )
    names = list(UNLISTED if kind == "unknown" else PLANTED)
    effects = planted({"none": 0, "two": 2}.get(kind, 1), names, hanger, state, plan, rng)
    if effects is None:
        return None
    try:
        size = size_of(hanger, state, effects, plan) if effects else 0.0
        campaign = campaign_with_truth(hanger, state, effects, plan, rng)
    except UsageError:
        return None
    return Made(asked, kind, hanger, effects, size, campaign)


def rod(rng: np.random.Generator) -> Hanger:
    """A round steel hanger of an arch bridge, at a fifth to a half of its yield stress."""
    while True:
        length_m, diameter_m = float(rng.uniform(6, 15)), float(rng.uniform(0.08, 0.14))
        area_m2 = np.pi * diameter_m**2 / 4
        tension_n = float(rng.uniform(0.2, 0.5)) * YIELD_PA * area_m2
        if 150e3 < tension_n < 900e3:
            break
    return Hanger(
        id=1,
        length_m=length_m,
        elastic_modulus_pa=200e9,
        area_m2=area_m2,
        second_moment_m4=np.pi * diameter_m**4 / 64,
        mass_per_length_kg_m=7800 * area_m2,
        nominal_tension_n=tension_n,
        diameter_m=diameter_m,
    )


def planted(
    count: int,
    known: Sequence[str],
    hanger: Hanger,
    state: HangerState,
    plan: CampaignPlan,
    rng: np.random.Generator,
) -> tuple[PlantedEffect, ...] | None:
    """Different effects, each of its own size; None where no draw can be seen."""
    names = list(rng.permutation(known))
    effects: list[PlantedEffect] = []
    for name in names:
        if len(effects) == count:
            break
        if name.startswith(ON_SENSORS) and not plan.shapes:
            continue  # nobody knows where the sensors sit
        size = float(np.exp(rng.uniform(*np.log(SIZES_OF_A_PAIR if count == 2 else SIZES))))
        found = to_size(str(name), size, hanger, state, plan, rng)
        effects += [found] if found is not None else []
    return tuple(effects) if len(effects) == count else None


def to_size(
    name: str,
    size: float,
    hanger: Hanger,
    state: HangerState,
    plan: CampaignPlan,
    rng: np.random.Generator,
) -> PlantedEffect | None:
    """The effect drawn anew until it can have the size; at the weak end where it is never so
    small, None where it is never so large.
    """
    tests = [test.id for test in plan.tests(hanger)]
    places = seen(choices(name, plan.places_m(hanger), tests), plan)
    weak = None
    for _ in range(DRAWS_OF_A_CASE if places else 0):
        effect = drawn(name, str(rng.choice(places)), hanger, rng)
        scaled = scaled_to(size, hanger, state, effect, plan)
        if scaled is None:
            continue
        if size_of(hanger, state, [scaled], plan) < ABOUT * size:
            return scaled
        weak = weak or at_share(float(rng.uniform(*WEAK)), hanger, effect)
    return weak


def seen(places: Sequence[str], plan: CampaignPlan) -> list[str]:
    """Without those in a plane that is not measured."""
    hidden = {"transverse", "longitudinal"} - set(plan.planes)
    return [each for each in places if not any(each.endswith(plane) for plane in hidden)]
