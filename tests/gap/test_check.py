"""What a diagnosis would find: the twin follows physics, the search finds the smallest size."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shm.diagnosis_document import gap_check_document, gap_check_of
from shm.documents import dump
from shm.errors import BadInput
from shm.gap import check as module
from shm.gap.check import CheckOptions, check_gap, magnitude
from shm.gap.twin import Twin, usual_tests
from shm.models.effects import EFFECTS, Variant, parameters_of
from shm.report.gap_check_report import rows
from shm.values import EffectPrior, GapCheck, Hanger, ModalTest
from tests.helpers.comparing import assert_same
from tests.helpers.gap_campaigns import HANGER as PLAIN
from tests.helpers.gap_campaigns import simulated
from tests.helpers.gap_checks import frequencies_hz, names_from

MASS = CheckOptions(("distributed_mass",), "beam1", sound=2)


@pytest.fixture(scope="module")
def tests() -> tuple[ModalTest, ...]:
    return simulated(seed=101, tension_spread=0.0)


@pytest.fixture(scope="module", autouse=True)
def twins() -> Iterator[None]:
    """Fit a twin once, whichever tests ask for it: it never changes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "Twin", cache(Twin))
        yield


@pytest.fixture(scope="module")
def twin(tests: tuple[ModalTest, ...]) -> Twin:
    found = module.Twin(tests, PLAIN, "beam1", 1)
    assert found.tension_n == pytest.approx(711e3, rel=0.03)
    assert found.misfit_percent < 0.1
    return found


@pytest.fixture
def checked(
    twin: Twin, tests: tuple[ModalTest, ...], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., GapCheck]:
    """Return a check by diagnoses that name effects from a change of frequency on."""

    def check(
        *named: str, least: float = 0.01, options: CheckOptions = MASS, hanger: Hanger = PLAIN
    ) -> GapCheck:
        monkeypatch.setattr(module, "diagnose", names_from(twin, least, *named))
        return check_gap(tests, hanger, options)

    return check


def unplanted(twin: Twin, seed: int = 5) -> tuple[ModalTest, ...]:
    return twin.measure("", Variant(), np.empty(0), np.random.default_rng(seed))


def planted(twin: Twin, effect: str, value: float) -> tuple[ModalTest, ...]:
    """Measure the twin with an effect of one parameter."""
    (parameter,) = parameters_of(effect, PLAIN, Variant())
    share = parameter.share(np.array([value]))
    return twin.measure(effect, Variant(), share, np.random.default_rng(5))


def test_a_twin_follows_the_planted_mass(twin: Twin) -> None:
    """Frequencies of a heavier uniform bar at the same tension fall by sqrt(1 + change)."""
    heavier = frequencies_hz(planted(twin, "distributed_mass", 0.2))
    np.testing.assert_allclose(heavier / frequencies_hz(unplanted(twin)), 1.2**-0.5, rtol=1e-6)


def test_a_twin_errs_as_stated(twin: Twin) -> None:
    drawn = [frequencies_hz(unplanted(twin, seed)) for seed in range(200)]
    scatter = np.std(np.log(drawn), axis=0)
    assert (scatter > 0.8 * twin.frequency_sd).all()  # and what repeats comes on top
    assert (scatter < 0.01).all()


def test_a_gap_of_the_hanger_is_no_error(tests: tuple[ModalTest, ...]) -> None:
    """Frequencies without a stated error, 5 % off in one plane."""
    off = tuple(
        replace(
            mode,
            frequency_hz=mode.frequency_hz * (1.05 if mode.plane == "transverse" else 1.0),
            frequency_sd_hz=np.nan,
        )
        for mode in tests[0].modes
    )
    twin = Twin([replace(tests[0], modes=off)], PLAIN, "beam1", 1)
    assert twin.misfit_percent > 1
    assert twin.frequency_sd == pytest.approx(3e-4)
    assert not any(mode.frequency_sd_hz > 0 for mode in unplanted(twin)[0].modes)


def test_a_twin_keeps_shapes_and_conditions(twin: Twin, tests: tuple[ModalTest, ...]) -> None:
    (made,), (given,) = unplanted(twin), tests
    assert (made.id, made.temperature_c, made.amplitude) == ("t1", given.temperature_c, 1.0)
    for own, theirs in zip(made.modes, given.modes, strict=True):
        for one, other in zip(own.shape, theirs.shape, strict=True):
            assert (one.x_m, one.sd) == (other.x_m, other.sd)
            swings = [math.hypot(each.value, each.cross) for each in (one, other)]
            assert swings[0] == pytest.approx(swings[1], abs=0.1)  # in whatever direction


def test_a_twin_shows_hardening_within_a_test(tests: tuple[ModalTest, ...], twin: Twin) -> None:
    assert "geometric_hardening" in twin.invisible()
    flat = {"amplitude_slope": 0.0, "amplitude_slope_sd": 1e-5}
    modes = tuple(replace(mode, **flat) for mode in tests[0].modes)
    twin = Twin([replace(tests[0], modes=modes)], PLAIN, "beam1", 1)
    assert "geometric_hardening" not in twin.invisible()
    (made,) = planted(twin, "geometric_hardening", 0.01)
    (sound,) = unplanted(twin)
    assert all(mode.depends_on_amplitude and mode.amplitude_slope > 0 for mode in made.modes[:2])
    assert not any(mode.depends_on_amplitude for mode in sound.modes)
    # The frequency is that of small amplitude, which hardening leaves alone.
    assert made.modes[0].frequency_hz == pytest.approx(sound.modes[0].frequency_hz, rel=1e-4)


def test_the_smallest_size_is_found(checked: Callable[..., GapCheck]) -> None:
    """And a gap in a sound twin is counted."""
    assert checked("sag", least=0.0).false_gaps == 2
    found = checked("distributed_mass", least=0.005, options=replace(MASS, baseline=""))
    (effect,) = found.effects
    assert found.baseline == "beam1"
    assert found.is_complete
    assert found.false_gaps == 0
    assert len(found.sound) == 2
    assert (effect.name, effect.unit) == ("mass_change", "fraction")
    # Half of the mass change is that of the frequencies: 0.2, 1, 5 and 17 % at these sizes.
    np.testing.assert_allclose(effect.sizes, 0.002 * 500 ** (np.arange(1, 8, 2) / 8))
    assert [(trial.step, trial.outcome) for trial in effect.trials] == [
        (2, "alone"),
        (1, "alone"),
        (0, "no gap"),
    ]
    assert effect.size == effect.sizes[1]
    assert rows(found) == [
        ("distributed mass", "2.1 % or more", "", "2.1 % or more", "0.43 %: not visible")
    ]


@pytest.mark.parametrize(
    ("named", "outcome", "others", "row"),
    [
        (("timebase", "distributed_mass"), "in a group", ("timebase",), "timebase"),
        (("distributed_mass + sag",), "in a group", ("sag",), "sag"),
        (("timebase",), "another cause", ("timebase",), ""),
        ((), "unexplained", (), ""),
    ],
)
def test_an_outcome_names_what_leads(
    checked: Callable[..., GapCheck],
    named: tuple[str, ...],
    outcome: str,
    others: tuple[str, ...],
    row: str,
) -> None:
    found = checked(*named)
    first = found.effects[0].trials[0]
    assert (first.outcome, first.others) == (outcome, others)
    assert rows(found)[0][2] == row
    assert first.is_found == (found.effects[0].found_from is not None)


def test_a_refused_twin_is_not_found(
    tests: tuple[ModalTest, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise BadInput("nothing fits.", remedy="Look at the description.")

    monkeypatch.setattr(module, "diagnose", refuse)
    found = check_gap(tests, PLAIN, replace(MASS, sound=0))
    assert {trial.outcome for trial in found.effects[0].trials} == {"refused"}
    assert rows(found)[0][4] == "46 %: refused: nothing fits"


def test_half_of_the_seeds_decide(checked: Callable[..., GapCheck]) -> None:
    """A mass is found or not by where it sits; each seed has a place and noise of its own."""
    options = CheckOptions(("point_mass",), "beam1", seeds=3, sound=0, seed=7)
    found = checked("point_mass", least=0.005, options=options)
    (effect,) = found.effects
    from_each = sorted(
        min((t.step for t in effect.trials if t.seed == seed and t.is_found), default=4)
        for seed in (7, 8, 9)
    )
    assert from_each[0] < from_each[2]
    assert effect.found_from == from_each[1]
    assert len({trial.parameters[1].value for trial in effect.trials}) == 3


@pytest.mark.parametrize("name", EFFECTS)
def test_sizes_of_an_effect_grow_away_from_nothing(twin: Twin, name: str) -> None:
    if name in twin.invisible():
        pytest.skip("not visible in this test")
    size = parameters_of(name, PLAIN, twin.variants(name)[0])[0]
    steps = [magnitude(size, step, 4) for step in range(4)]
    away = np.diff(steps) if np.isfinite(size.zero) else -np.diff(steps)
    assert (away > 0).all()
    assert ((size.lower < np.array(steps)) & (np.array(steps) < size.upper)).all()


def test_an_owners_range_bounds_the_sizes(checked: Callable[..., GapCheck]) -> None:
    prior = EffectPrior("distributed_mass", "mass_change", 0.01, 0.02)
    narrow, options = replace(PLAIN, effect_priors=(prior,)), replace(MASS, sound=0)
    found = checked("distributed_mass", least=0.0, options=options, hanger=narrow)
    (effect,) = found.effects
    assert 0.01 < effect.sizes[0] < effect.sizes[-1] < 0.02


def test_without_tests_a_usual_test_is_made() -> None:
    twin = Twin((), PLAIN, "beam1", 1)
    assert twin.tension_n == pytest.approx(711e3, rel=1e-6)
    assert [test.id for test in twin.tests] == [test.id for test in usual_tests(PLAIN)]
    assert twin.frequency_sd == pytest.approx(3e-4)
    truth = simulated(modes=8, as_made=False, tension_spread=0.0)
    np.testing.assert_allclose(frequencies_hz(twin.tests[:1]), frequencies_hz(truth), rtol=1e-3)


def test_a_check_is_read_back(checked: Callable[..., GapCheck]) -> None:
    options = replace(MASS, effects=("distributed_mass", "sensor_mass", "load_scale"), sound=1)
    found = checked("timebase", "distributed_mass", options=options)
    document = json.loads(dump(gap_check_document(found)))
    assert document["schema"] == "shm.gap_check/1"
    assert document["effects"][0]["others"] == ["timebase"]
    assert document["invisible"][0]["effect"] == "load_scale"
    assert_same(gap_check_of(document), found)


@pytest.mark.slow
def test_a_clamp_is_found_and_a_sound_hanger_left_alone(tests: tuple[ModalTest, ...]) -> None:
    found = check_gap(tests, PLAIN, CheckOptions(("point_mass", "load_scale"), sound=3))
    (mass,) = found.effects
    assert mass.effect == "point_mass"
    assert mass.found_from is not None
    assert found.false_gaps == 0
    assert [name for name, _ in found.invisible] == ["load_scale"]
