"""Bars held otherwise than by clamps: closed forms, and what can act at which end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from shm.errors import UsageError
from shm.inference.problem.described import DescribedCoordinates
from shm.models import MODELS, AsMade, applicable, build, check_baseline, competing_names
from shm.models.classes.beam import Beam1
from shm.models.effects import EFFECTS, Conditions, Survey, parameters_of
from shm.models.hanger import PhysicalHanger, solve
from shm.values import PLANES, FloatArray, Hanger, Supports
from tests.helpers.hangers import HANGER_3, ROD
from tests.helpers.physical_hangers import EI, LENGTH, MASS, NOWHERE, TENSION

UNIT_HZ = np.sqrt(EI / MASS) / LENGTH**2 / (2 * np.pi)
ORDERS = np.arange(1, 7)
EVERYTHING = Survey(("t1", "t2"), PLANES, (6.0,), True, (0.0, 20.0), (0.5, 1.0), ())
FREE = Supports("free", "free")
PINNED = Supports("pinned", "pinned")
HANGING = Supports("free", "pinned", 500.0)


def held(supports: Supports, tension_n: float) -> PhysicalHanger:
    return PhysicalHanger.held(replace(HANGER_3, supports=supports), np.array([tension_n]))


def beam_1(hanger: Hanger) -> AsMade:
    return AsMade(MODELS["beam1"](hanger))


def middle_of(hanger: Hanger, scores: Sequence[float]) -> FloatArray:
    """Make parameter sets of beam1 by scores of the tension, all else at its middle."""
    known = hanger.scatter.tension
    described = DescribedCoordinates(beam_1(hanger), (), 1.0, known_tension_sd=known)
    z = np.zeros((len(scores), described.dimension))
    z[:, 0] = scores
    return described.theta(z)


def both_ways(physical: PhysicalHanger, modes: int) -> list[FloatArray]:
    """The transverse frequencies found without shapes and with them."""
    alone = solve(physical, modes, NOWHERE, shapes=False)
    seen = solve(physical, modes, np.array([1.0, 5.0]))
    return [alone.frequency_hz[0, 0], seen.frequency_hz[0, 0]]


@pytest.mark.parametrize("tension_n", [0.0, 1e3, TENSION, 5e7])
def test_a_pinned_bar_is_a_sum_of_string_and_beam(tension_n: float) -> None:
    """(omega/unit)^2 = (n pi)^4 + T L^2/EI (n pi)^2."""
    waves = ORDERS * np.pi
    expected = np.sqrt(waves**4 + tension_n * LENGTH**2 / EI * waves**2) * UNIT_HZ
    for found in both_ways(held(PINNED, tension_n), 6):
        np.testing.assert_allclose(found, expected, rtol=1e-8)


@pytest.mark.parametrize(
    ("supports", "ends"),
    [(Supports(), {(0,), (1,), (0, 1)}), (HANGING, {(1,)}), (FREE, set())],
)
@pytest.mark.parametrize(
    "name", ["rotational_end_flexibility", "translational_end_flexibility", "support_motion"]
)
def test_what_needs_a_held_end_does_not_act_at_a_free_one(
    name: str, supports: Supports, ends: set[tuple[int, ...]]
) -> None:
    hanger = replace(HANGER_3, supports=supports)
    variants = EFFECTS[name].variants(hanger, EVERYTHING)
    assert {each.ends for each in variants} == {e for e in ends if len(e) == 1 or name[0] != "s"}
    assert bool(EFFECTS[name].invisible(hanger, EVERYTHING)) == (not ends)


@pytest.mark.parametrize("name", EFFECTS)
@pytest.mark.parametrize("supports", [FREE, HANGING, PINNED])
@pytest.mark.parametrize("tension_n", [0.0, TENSION])
def test_every_effect_that_may_act_gives_finite_frequencies(
    name: str, supports: Supports, tension_n: float
) -> None:
    hanger = replace(HANGER_3, supports=supports, nominal_tension_n=tension_n)
    if EFFECTS[name].invisible(hanger, EVERYTHING):
        return
    for variant in EFFECTS[name].variants(hanger, EVERYTHING):
        acted_on = beam_1(hanger).with_effects([(name, variant)], (6.0,))
        middle = [[each.value(np.array(0.4)) for each in parameters_of(name, hanger, variant)]]
        theta = np.hstack([middle_of(hanger, [0.0]), middle])
        modes = acted_on.modes(theta, Conditions("t1"), 4)
        assert np.isfinite(modes.frequency_hz).all(), variant
        assert (modes.frequency_hz > 0).all(), variant
        assert np.isfinite(modes.shape).all(), variant


@pytest.mark.parametrize(
    ("changed", "why"),
    [({"supports": PINNED}, "pinned"), ({"nominal_tension_n": 0.0}, "no tension")],
)
def test_the_classes_of_updating_refuse_what_is_held_otherwise(
    changed: dict[str, object], why: str
) -> None:
    hanger = replace(HANGER_3, **changed)  # type: ignore[arg-type]
    fitting, reasons = applicable(hanger, ["beam1", "beam2", "s1", "solid2"])
    assert fitting == ()
    assert all(why in reason for reason in reasons.values())
    with pytest.raises(UsageError, match=why):
        build("beam1", hanger)


def test_a_diagnosis_takes_beam1_as_it_is_described_and_no_other_class() -> None:
    hanger = replace(HANGER_3, supports=HANGING)
    check_baseline("beam1", hanger)
    check_baseline("solid2", HANGER_3)
    with pytest.raises(UsageError, match="free"):
        check_baseline("beam2", hanger)
    with pytest.raises(UsageError, match="unknown"):
        check_baseline("beam9", hanger)
    admits = replace(hanger, models=("beam2",))
    with pytest.raises(UsageError, match="admits"):
        check_baseline("beam1", admits)


class Plated(Beam1):
    """A class that needs end plates."""

    name = "plated"

    @classmethod
    def unfit(cls, hanger: Hanger) -> str:
        return "" if hanger.plate else "it needs end plates."


@pytest.fixture
def plated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(MODELS, "plated", Plated)


@pytest.mark.usefixtures("plated")
def test_a_class_that_cannot_describe_the_hanger_says_why() -> None:
    names = ["beam1", "plated", "beam2"]
    assert applicable(HANGER_3, names) == (("beam1", "plated", "beam2"), {})
    assert applicable(ROD, names) == (("beam1", "beam2"), {"plated": "it needs end plates."})
    assert competing_names(ROD, ["beam1", "plated"]) == ("beam1",)
    with pytest.raises(UsageError, match=r"hanger 3.*plated: it needs end plates"):
        competing_names(ROD, ["plated"])
