"""A plan of measurements: what its steps promise, in which order, at which cost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.causes.search import Attribution, attribute
from shm.gap.hypotheses.contract import GapOptions
from shm.gap.next_measurement.experiment_design import lift_off
from shm.gap.next_measurement.measurement_plan import (
    NO_GAP,
    UNKNOWN,
    Race,
    explanations,
    holds,
    nothing_planned,
    planned,
)
from shm.simulate import PlantedEffect
from shm.values import MEASUREMENT_HOURS
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import problem_of, simulated
from tests.helpers.hangers import ROD

SOFTER = PlantedEffect("bending_stiffness", "everywhere", {"stiffness_change": -0.2})
OPTIONS = GapOptions(without=all_but("distributed_mass", "bending_stiffness"))


@pytest.fixture(scope="module")
def found() -> Attribution:
    """One plane's frequencies, in which more mass is the same as less bending stiffness."""
    tests = simulated(SOFTER, hanger=ROD, planes=("transverse",), modes=8, shapes=False)
    return attribute(problem_of(tests, hanger=ROD), OPTIONS, np.random.default_rng(1))


@pytest.fixture(scope="module")
def race(found: Attribution) -> Race:
    return Race.of(found, np.random.default_rng(1))


def test_a_known_mass_comes_first_and_is_enough(race: Race) -> None:
    steps = planned(race)
    assert steps[0].kind == "known mass"
    assert steps[0].promised_log_odds > 3
    assert steps[-1].probability > 0.9
    assert [step.log_odds for step in steps] == sorted(step.log_odds for step in steps)


def test_what_costs_too_much_is_not_planned(race: Race) -> None:
    dear = {**MEASUREMENT_HOURS, "known mass": 50.0}
    steps = planned(race, dear, budget_hours=40.0)
    assert "known mass" not in {step.kind for step in steps}
    assert sum(step.hours for step in steps) <= 40.0
    assert planned(race, budget_hours=0.1) == ()
    said = nothing_planned(race, MEASUREMENT_HOURS, 0.1)
    worth = race.expected([])[0] + 0.2
    promising = [each for k, each in enumerate(race.offered) if race.expected([k])[0] > worth]
    least = min(MEASUREMENT_HOURS[each.kind] for each in promising)
    assert "fits into 0.1 h" in said
    assert said.endswith(f"takes {least:g} h.")


def test_where_the_data_are_enough_an_empty_plan_says_so(race: Race) -> None:
    first, *others = race.contenders
    sure = [replace(first, probability=0.99)]
    sure += [replace(each, probability=0.01 / len(others)) for each in others]
    certain = replace(race, contenders=tuple(sure))
    assert planned(certain) == ()
    assert "data are enough" in nothing_planned(certain, MEASUREMENT_HOURS, np.inf)


def test_before_any_measurement_the_odds_are_those_of_the_evidence(
    found: Attribution, race: Race
) -> None:
    now = {each.name: each.probability for each in explanations(found)}
    assert sum(now.values()) == pytest.approx(1.0)
    of_mass, of_stiffness = (
        sum(chance for name, chance in now.items() if holds(name, cause))
        for cause in ("distributed_mass", "bending_stiffness")
    )
    assert abs(of_mass - of_stiffness) < 0.5
    own = [each.probability for each in race.contenders]
    assert sum(own) == pytest.approx(1.0)
    named = [each.name for each in race.contenders]
    held = [sum(p for n, p in zip(named, own, strict=True) if holds(n, one)) for one in named]
    assert race.expected([])[1] == pytest.approx(float(np.dot(own, held)))
    assert holds("sag + point_mass", "point_mass")
    assert not holds("point_mass", "sag + point_mass")
    assert not holds("point_mass", NO_GAP)
    assert holds(UNKNOWN, UNKNOWN)


def test_the_same_mass_elsewhere_adds_less_than_it_promised_alone(race: Race) -> None:
    masses = [k for k, each in enumerate(race.offered) if each.kind == "known mass"][:2]
    none = race.expected([])[0]
    alone = [race.expected([k])[0] - none for k in masses]
    assert race.expected(masses)[0] - none < 0.8 * sum(alone)


def test_a_lift_off_tells_mass_by_the_tension_and_is_offered_once(race: Race) -> None:
    (index,) = [k for k, each in enumerate(race.offered) if each.kind == "lift-off"]
    repeat = [each.kind for each in race.offered].index("repeat")
    assert race.expected([index])[0] > race.expected([repeat])[0] + 1.0
    weighed = replace(ROD, scatter=replace(ROD.scatter, tension=0.01))
    assert lift_off(race.offered[0].design, weighed) == ()


def test_something_unknown_is_in_the_race_and_foresees_less_surely(race: Race) -> None:
    """Beside the causes that it comes with, in one of several ways."""
    unknown = [each for each in race.contenders if UNKNOWN in each.name]
    assert unknown
    for contender in unknown:
        assert sum(share for share, _ in contender.ways) == pytest.approx(1.0)
        known = next(e for e in race.contenders if f"{e.name} + {UNKNOWN}" == contender.name)
        plane = race.rows[[each.kind for each in race.offered].index("other plane")]
        shares = [share for share, _ in contender.ways]
        *variances, alone = (
            np.trace(seen.covariance[np.ix_(plane, plane)])
            for _, seen in (*contender.ways, known.ways[0])
        )
        assert np.average(variances, weights=shares) > alone
