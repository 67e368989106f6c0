"""Measurement campaigns: modal tests of a hanger with planted effects, as identification gives.

What a campaign measures, under which conditions and how well; modes of one test as identification
reports them: with noise and what it says of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import UsageError
from shm.simulate import PlantedEffect
from shm.simulate.state import HangerState
from shm.values import (
    NAN,
    PLANES,
    AddedMass,
    FloatArray,
    Hanger,
    ModalTest,
    Mode,
    Plane,
    ShapePoint,
)
from tests.worlds.simulated.bar.description import Bar
from tests.worlds.simulated.effects.base import TestConditions
from tests.worlds.simulated.planted import PlantedModes, bar_under, modes_under
from tests.worlds.simulated.reality import (
    Deviations,
    Reality,
    SensorError,
    drawn_sensors,
    drawn_waves,
    sd_factors,
)

# Fractions of the length, from the deck and from a lift, near no node of the lowest eight modes.
_PLACES = (0.13, 0.29, 0.45, 0.66)
_MASS_PLACE = 0.3


@dataclass(frozen=True)
class CampaignPlan:
    """What is measured, under which conditions and how well.

    One test at each temperature at the reference level, one at each further level at the middle
    temperature, and one there with a known mass of `mass_share` of the hanger's at 0.3 of
    its length (share 0: none). A NaN temperature or amplitude is one that nobody noted. `sensors`
    (1 to 4) places hold an accelerometer each, unless `sensors_x_m` names them; one that is not
    biaxial measures in the hit plane. `frequency_sd` is a fraction; `shape_sd` a share of the
    shape's largest component; `damping_sd` a fraction of the damping ratio. The tension is drawn
    about the state's with `tension_spread`, a fraction; `as_made` draws the bar's deviations. With
    a `reality` the campaign departs from the textbook as it says.
    """

    planes: tuple[Plane, ...] = PLANES
    modes: int = 8
    sensors: int = 4
    sensors_x_m: tuple[float, ...] = ()
    shapes: bool = True
    biaxial: bool = True
    temperatures_c: tuple[float, ...] = (-5.0, 10.0, 25.0)
    amplitudes: tuple[float, ...] = (0.3, 1.0, 2.0)
    mass_share: float = 0.02
    frequency_sd: float = 1e-4
    shape_sd: float = 0.005
    damping_sd: float = 0.1
    tension_spread: float = 0.1
    as_made: bool = True
    reality: Reality | None = None

    @property
    def own_laws(self) -> bool:
        return self.reality is not None and self.reality.own_laws

    def places_m(self, hanger: Hanger) -> tuple[float, ...]:
        """Where the accelerometers sit."""
        chosen = tuple(round(share * hanger.length_m, 3) for share in _PLACES[: self.sensors])
        return self.sensors_x_m or chosen

    def tests(self, hanger: Hanger) -> tuple[ModalTest, ...]:
        """The tests with their conditions, before anything is measured."""
        _refuse_unless_possible(self)
        middle = sorted(self.temperatures_c)[len(self.temperatures_c) // 2]
        usual, *others = sorted(self.amplitudes, key=lambda level: abs(level - 1))
        conditions = [(each, usual) for each in self.temperatures_c]
        conditions += [(middle, level) for level in self.amplitudes if level in others]
        masses: list[AddedMass | None] = [None] * len(conditions)
        if self.mass_share:
            own = hanger.mass_per_length_kg_m * hanger.length_m
            conditions.append((middle, usual))
            masses.append(AddedMass(self.mass_share * own, _MASS_PLACE * hanger.length_m))
        return tuple(
            ModalTest(f"t{i + 1}", (), hanger.id, None, warmth, level, mass)
            for i, ((warmth, level), mass) in enumerate(zip(conditions, masses, strict=True))
        )


def _refuse_unless_possible(plan: CampaignPlan) -> None:
    if plan.modes < 1 or not plan.planes or not plan.temperatures_c or not plan.amplitudes:
        raise UsageError(
            "a campaign needs planes, modes, a temperature and a level.",
            remedy="Give one of each at least; NaN for a temperature or level that is unknown.",
        )
    if not plan.sensors_x_m and not 1 <= plan.sensors <= len(_PLACES):
        raise UsageError(
            f"{plan.sensors} sensors have no usual places.",
            remedy=f"Take 1 to {len(_PLACES)}, or give their places.",
        )


@dataclass(frozen=True)
class TrueFrequency:
    """The frequency that a test would have shown without any error."""

    test: str
    plane: Plane
    order: int
    frequency_hz: float


@dataclass(frozen=True)
class CampaignTruth:
    """What a campaign was made of.

    `frequencies` are those of the planes and modes that the plan measures, without any noise, as
    the logger's clock counts them. `sensors` hold an error each, or none stands there.
    """

    tension_n: float
    deviations: Deviations
    effects: tuple[PlantedEffect, ...]
    frequencies: tuple[TrueFrequency, ...] = ()
    sensors: tuple[SensorError, ...] = ()


@dataclass(frozen=True)
class Campaign:
    """The modal tests and their truth."""

    tests: tuple[ModalTest, ...]
    truth: CampaignTruth


def campaign(
    hanger: Hanger,
    state: HangerState,
    effects: Sequence[PlantedEffect],
    plan: CampaignPlan,
    rng: np.random.Generator,
) -> tuple[ModalTest, ...]:
    """The tests of `campaign_with_truth`."""
    return campaign_with_truth(hanger, state, effects, plan, rng).tests


def campaign_with_truth(
    hanger: Hanger,
    state: HangerState,
    effects: Sequence[PlantedEffect],
    plan: CampaignPlan,
    rng: np.random.Generator,
) -> Campaign:
    """Modal tests with normal noise; the same generator state gives the same tests.

    Tension, deviations, errors of sensors and noise do not depend on the effects. Raises UsageError
    for an effect or plan that cannot be.
    """
    made, noise = rng.spawn(2)
    truth, exact = _realised(hanger, state, effects, plan, made)
    factors = sd_factors(hanger, state, plan)
    measured = tuple(
        replace(test, modes=identified(found, factors, hanger, plan, noise))
        for test, found in zip(plan.tests(hanger), exact, strict=True)
    )
    return Campaign(measured, truth)


def bar_in_test(
    hanger: Hanger, state: HangerState, truth: CampaignTruth, plan: CampaignPlan, test: ModalTest
) -> Bar:
    """The bar of a campaign in one of its tests, with effects, known mass and turned sensors.

    `turned_rad` goes by the places that are said; a sensor sits at its true one, `x_m + off_m`.
    """
    return bar_under(
        hanger,
        replace(state, tension_n=truth.tension_n),
        truth.effects,
        conditions_of(hanger, plan, test),
        plan.places_m(hanger),
        deviations=truth.deviations,
        sensors=truth.sensors,
        own_laws=plan.own_laws,
    )


def conditions_of(hanger: Hanger, plan: CampaignPlan, test: ModalTest) -> TestConditions:
    """What effects are told of one test of a plan."""
    return TestConditions(
        test.id,
        _shift(plan.tests(hanger), test.temperature_c),
        1.0 if np.isnan(test.amplitude) else test.amplitude,
        test.added_mass,
    )


def noiseless(
    hanger: Hanger, state: HangerState, truth: CampaignTruth, plan: CampaignPlan, test: ModalTest
) -> PlantedModes:
    """What one test of a campaign would say without noise."""
    bar = bar_in_test(hanger, state, truth, plan, test)
    return modes_under(bar, plan.modes, plan.places_m(hanger), truth.sensors)


def _realised(
    hanger: Hanger,
    state: HangerState,
    effects: Sequence[PlantedEffect],
    plan: CampaignPlan,
    rng: np.random.Generator,
) -> tuple[CampaignTruth, list[PlantedModes]]:
    """The truth, and the modes without error of each test."""
    tests = plan.tests(hanger)
    deviations, factor = _drawn_deviations(hanger, plan, rng)
    sensors: tuple[SensorError, ...] = ()
    if plan.reality is not None:
        waves = drawn_waves(plan.reality, rng)
        deviations = replace(deviations, section_waves=waves if plan.as_made else ())
        sensors = drawn_sensors(plan.reality, plan.places_m(hanger), rng)
    tension_n = state.tension_n * factor
    truth = CampaignTruth(tension_n, deviations, tuple(effects), sensors=sensors)
    exact = [noiseless(hanger, state, truth, plan, test) for test in tests]
    return replace(truth, frequencies=_frequencies(tests, exact, plan)), exact


def _frequencies(
    tests: Sequence[ModalTest], exact: Sequence[PlantedModes], plan: CampaignPlan
) -> tuple[TrueFrequency, ...]:
    return tuple(
        TrueFrequency(test.id, plane, order + 1, float(found.frequency_hz[number, order]))
        for test, found in zip(tests, exact, strict=True)
        for number, plane in enumerate(PLANES)
        if plane in plan.planes
        for order in range(plan.modes)
    )


def _shift(tests: Sequence[ModalTest], temperature_c: float) -> float:
    """How much warmer than the mean of the tests."""
    known = [test.temperature_c for test in tests if not np.isnan(test.temperature_c)]
    return 0.0 if np.isnan(temperature_c) else float(temperature_c - np.mean(known))


def _drawn_deviations(
    hanger: Hanger, plan: CampaignPlan, rng: np.random.Generator
) -> tuple[Deviations, float]:
    """The bar as made, and the tension over the state's."""
    scatter, (tension, *four) = hanger.scatter, rng.standard_normal(5)
    sds = (scatter.section, scatter.density, scatter.length, scatter.modulus)
    section, density, length, modulus = (
        float(sd * each) for sd, each in zip(sds, four, strict=True)
    )
    made = Deviations(section, density, length, modulus) if plan.as_made else Deviations()
    return made, float(np.exp(plan.tension_spread * tension))


@dataclass(frozen=True, eq=False)
class _Stated:
    """Standard deviations that are stated, (planes, modes): frequencies' in Hz."""

    frequency_hz: FloatArray
    shape: FloatArray


def identified(
    true: PlantedModes,
    sd_factors: FloatArray,
    hanger: Hanger,
    plan: CampaignPlan,
    rng: np.random.Generator,
) -> tuple[Mode, ...]:
    """Modes of one test with noise; draws are made for both planes whatever is measured.

    `sd_factors` (planes, modes) are the standard deviations' over the plan's.
    """
    scatter = rng.standard_normal((2, *true.frequency_hz.shape))
    along = rng.standard_normal(true.shape.shape)
    if plan.reality is not None:
        rho = plan.reality.correlation(true.frequency_hz)
        scatter[0, 1] = rho * scatter[0, 0] + np.sqrt(1 - rho**2) * scatter[0, 1]
    noisy = PlantedModes(
        true.frequency_hz * (1 + plan.frequency_sd * sd_factors * scatter[0]),
        true.shape + plan.shape_sd * sd_factors[..., None, None] * along,
        true.damping_ratio * np.exp(plan.damping_sd * scatter[1]),
    )
    stated = _stated(noisy, sd_factors, plan, rng)
    places = plan.places_m(hanger)
    return tuple(
        _mode(noisy, stated, PLANES.index(plane), order, places, plan)
        for plane in plan.planes
        for order in range(plan.modes)
    )


def _stated(
    noisy: PlantedModes, sd_factors: FloatArray, plan: CampaignPlan, rng: np.random.Generator
) -> _Stated:
    """What the scatter of few hits says, where there is a reality; else the truth."""
    guess = np.ones((2, *sd_factors.shape))
    if plan.reality is not None:
        freedom = plan.reality.sd_freedom
        guess = np.sqrt(rng.chisquare(freedom, guess.shape) / freedom)
    return _Stated(
        plan.frequency_sd * sd_factors * guess[0] * noisy.frequency_hz,
        plan.shape_sd * sd_factors * guess[1],
    )


def _mode(
    noisy: PlantedModes,
    stated: _Stated,
    plane: int,
    order: int,
    places: Sequence[float],
    plan: CampaignPlan,
) -> Mode:
    damping = float(noisy.damping_ratio[plane, order])
    seen, sd = noisy.shape[plane, order], float(stated.shape[plane, order])
    return Mode(
        PLANES[plane],
        order + 1,
        float(noisy.frequency_hz[plane, order]),
        float(stated.frequency_hz[plane, order]) or NAN,
        damping,
        plan.damping_sd * damping or NAN,
        _shape(seen, plane, places, plan.biaxial, sd) if plan.shapes else (),
    )


def _shape(
    seen: FloatArray, plane: int, places: Sequence[float], biaxial: bool, sd: float
) -> tuple[ShapePoint, ...]:
    return tuple(
        ShapePoint(place, float(own[plane]), float(own[1 - plane]) if biaxial else NAN, sd or NAN)
        for place, own in zip(places, seen, strict=True)
    )
