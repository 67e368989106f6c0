"""Measurement campaigns: modal tests of a hanger with planted effects, as identification gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import UsageError
from shm.simulate.effects import PlantedEffect, TestConditions
from shm.simulate.planted import Deviations, PlantedModes, planted_modes
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

# Fractions of the length, from the deck and from a lift, near no node of the lowest eight modes.
_PLACES = (0.13, 0.29, 0.45, 0.66)


@dataclass(frozen=True)
class CampaignPlan:
    """What is measured, under which conditions and how well.

    One test at each temperature at the reference level, one at each further level at the middle
    temperature, and one there with a known mass of `mass_share` of the hanger's at `mass_place` of
    its length (share 0: none). A NaN temperature or amplitude is one that nobody noted. `sensors`
    (1 to 4) places hold an accelerometer each, unless `sensors_x_m` names them; one that is not
    biaxial measures in the hit plane. `frequency_sd` is a fraction; `shape_sd` a share of the
    shape's largest component; `damping_sd` a fraction of the damping ratio. The tension is drawn
    about the state's with `tension_spread`, a fraction; `as_made` draws the bar's deviations.
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
    mass_place: float = 0.3
    frequency_sd: float = 1e-4
    shape_sd: float = 0.005
    damping_sd: float = 0.1
    tension_spread: float = 0.1
    as_made: bool = True

    def places_m(self, hanger: Hanger) -> tuple[float, ...]:
        """Where the accelerometers sit."""
        chosen = tuple(round(share * hanger.length_m, 3) for share in _PLACES[: self.sensors])
        return self.sensors_x_m or chosen

    def tests(self, hanger: Hanger) -> tuple[ModalTest, ...]:
        """The tests with their conditions, before anything is measured."""
        _refuse_unless_possible(self)
        middle = sorted(self.temperatures_c)[len(self.temperatures_c) // 2]
        usual = min(self.amplitudes, key=lambda level: abs(level - 1))
        conditions = [(each, usual) for each in self.temperatures_c]
        conditions += [(middle, level) for level in self.amplitudes if level != usual]
        masses: list[AddedMass | None] = [None] * len(conditions)
        if self.mass_share:
            own = hanger.mass_per_length_kg_m * hanger.length_m
            conditions.append((middle, usual))
            masses.append(AddedMass(self.mass_share * own, self.mass_place * hanger.length_m))
        return tuple(
            ModalTest(f"t{i + 1}", (), hanger.id, None, warmth, level, mass)
            for i, ((warmth, level), mass) in enumerate(zip(conditions, masses, strict=True))
        )


@dataclass(frozen=True)
class CampaignTruth:
    """What a campaign was made of."""

    tension_n: float
    deviations: Deviations
    effects: tuple[PlantedEffect, ...]


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
    """Modal tests with independent normal noise; the same generator state gives the same tests.

    Tension, deviations and noise do not depend on the effects. Raises UsageError for an effect or
    plan that cannot be.
    """
    tests = plan.tests(hanger)
    made, noise = rng.spawn(2)
    deviations, factor = _drawn_deviations(hanger, plan, made)
    true_state = replace(state, tension_n=state.tension_n * factor)
    measured = tuple(
        replace(
            test, modes=_measured(noiseless(hanger, true_state, effects, plan, test, deviations),
                                  hanger, plan, noise)
        )
        for test in tests
    )  # fmt: skip
    truth = CampaignTruth(true_state.tension_n, deviations, tuple(effects))
    return Campaign(measured, truth)


def noiseless(
    hanger: Hanger,
    state: HangerState,
    effects: Sequence[PlantedEffect],
    plan: CampaignPlan,
    test: ModalTest,
    deviations: Deviations,
) -> PlantedModes:
    """What one test of a plan would say without noise."""
    conditions = TestConditions(
        test.id,
        _shift(plan.tests(hanger), test.temperature_c),
        1.0 if np.isnan(test.amplitude) else test.amplitude,
        test.added_mass,
    )
    places = plan.places_m(hanger)
    return planted_modes(
        hanger, state, effects, conditions, plan.modes, places, deviations=deviations
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
    drawn = [float(sd * each) for sd, each in zip(sds, four, strict=True)]
    made = Deviations(*drawn) if plan.as_made else Deviations()
    return made, float(np.exp(plan.tension_spread * tension))


def _measured(
    found: PlantedModes, hanger: Hanger, plan: CampaignPlan, rng: np.random.Generator
) -> tuple[Mode, ...]:
    """Modes of one test with noise; draws are made for both planes whatever is measured."""
    scatter = rng.standard_normal((2, *found.frequency_hz.shape))
    noisy = PlantedModes(
        found.frequency_hz * (1 + plan.frequency_sd * scatter[0]),
        found.shape + plan.shape_sd * rng.standard_normal(found.shape.shape),
        found.damping_ratio * np.exp(plan.damping_sd * scatter[1]),
    )
    places = plan.places_m(hanger)
    return tuple(
        _mode(noisy, PLANES.index(plane), order, places, plan)
        for plane in plan.planes
        for order in range(plan.modes)
    )


def _mode(
    noisy: PlantedModes, plane: int, order: int, places: Sequence[float], plan: CampaignPlan
) -> Mode:
    frequency = float(noisy.frequency_hz[plane, order])
    damping = float(noisy.damping_ratio[plane, order])
    return Mode(
        PLANES[plane],
        order + 1,
        frequency,
        plan.frequency_sd * frequency or NAN,
        damping,
        plan.damping_sd * damping or NAN,
        _shape(noisy.shape[plane, order], plane, places, plan),
    )


def _shape(
    seen: FloatArray, plane: int, places: Sequence[float], plan: CampaignPlan
) -> tuple[ShapePoint, ...]:
    if not plan.shapes:
        return ()
    return tuple(
        ShapePoint(
            place,
            float(own[plane]),
            float(own[1 - plane]) if plan.biaxial else NAN,
            plan.shape_sd or NAN,
        )
        for place, own in zip(places, seen, strict=True)
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
