"""Small campaigns of hanger 3, without its plates, by the general model and by the simulator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from shm.assumptions import DEFAULTS
from shm.gap.causes.scan import Scan, scan
from shm.gap.causes.search import fit_alone
from shm.gap.hypotheses.contract import Fit, Hypothesis
from shm.gap.hypotheses.observations import observed
from shm.gap.hypotheses.problem import GapProblem
from shm.gap.hypotheses.sampling import MOST_ROUNDS, Sampling
from shm.gap.hypotheses.target import Target
from shm.inference.sampler.density import find_peaks
from shm.inference.sampler.linear import Linear
from shm.models import MODELS, AsMade
from shm.models.effects import Conditions, Variant
from shm.models.one_hanger.hanger_model import DENSITY, LENGTH, MODULUS, SECTION, TENSION
from shm.simulate import HangerState, PlantedEffect
from shm.values import (
    ENOUGH_EFFECTIVE,
    NAN,
    PLANES,
    AddedMass,
    FloatArray,
    Hanger,
    ModalTest,
    Mode,
    ShapePoint,
)
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.campaign import CampaignPlan
from tests.worlds.simulated.campaign import campaign as simulate_campaign

TOUCHLESS = DEFAULTS.with_numbers(support_compliance_m_n=0.0, accelerometer_mass_kg=0.0)
"""Supports that do not give and sensors without mass, as simulated: their means, not their sds."""
HANGER = replace(HANGER_3, plate=None, assumptions=TOUCHLESS)
PLACES_M = (2.0, 4.5, 6.5, 9.0)
CLAMP = AddedMass(25.0, 3.6)
Effects = tuple[tuple[str, Variant], ...]
ONE_TEST = CampaignPlan(modes=6, temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0)
PLANTED_CLAMP = PlantedEffect("point_mass", "everywhere", {"mass_kg": 12.0, "x_m": 3.4})


def simulated(
    *effects: PlantedEffect, seed: int = 1, hanger: Hanger = HANGER, **plan: Any
) -> tuple[ModalTest, ...]:
    """Simulate one test of six modes at 711 kN with effects, or what else a plan has of it."""
    made, rng = replace(ONE_TEST, **plan), np.random.default_rng(seed)
    return simulate_campaign(hanger, HangerState(711e3), effects, made, rng)


def campaign(
    effects: Effects = (),
    values: Sequence[float] = (),
    tests: int = 2,
    modes: int = 6,
    sd: float = 2e-4,
    given_sd: bool = True,
    shape_sd: float = NAN,
    tension: float = 1.1,
    seed: int = 0,
) -> tuple[ModalTest, ...]:
    """Tests with `values` of the effects and deviations of 0.5 %; the last has a known mass.

    Shapes are measured where `shape_sd` is given.
    """
    rng = np.random.default_rng(seed)
    model = AsMade(MODELS["beam1"](HANGER))
    hanger = model.with_effects(effects, PLACES_M)
    section, density, length, modulus = 0.005 * rng.standard_normal(4)
    made = {TENSION: tension, LENGTH: 1 + length, SECTION: section, DENSITY: density}
    made |= {MODULUS: modulus, **{name: model.usual(name) for name in model.terms}}
    theta = np.array([[*(made[name] for name in model.parameter_names), *values]])
    model_error = 2e-5 * rng.standard_normal((2, modes))
    taken = []
    for t in range(tests):
        mass = CLAMP if t == tests - 1 else None
        found = hanger.modes(theta, Conditions(f"t{t + 1}", 0.0, 1.0, mass), modes)
        log = np.log(found.frequency_hz[0]) + model_error + sd * rng.standard_normal((2, modes))
        shape = found.shape[0] + np.nan_to_num(shape_sd) * rng.standard_normal(found.shape[0].shape)
        taken.append(
            ModalTest(
                f"t{t + 1}",
                tuple(
                    Mode(
                        plane,
                        order + 1,
                        float(np.exp(log[p, order])),
                        sd * float(np.exp(log[p, order])) if given_sd else NAN,
                        shape=_points(shape[p, order], p, shape_sd),
                    )
                    for p, plane in enumerate(PLANES)
                    for order in range(modes)
                ),
                hanger=3,
                added_mass=mass,
            )
        )
    return tuple(taken)


def problem_of(
    tests: Sequence[ModalTest], baseline: str = "beam1", hanger: Hanger = HANGER
) -> GapProblem:
    """Return the problem of tests of a hanger with a model class as its baseline."""
    return GapProblem(AsMade(MODELS[baseline](hanger)), tests, observed(tests, hanger))


def _points(shape: FloatArray, plane: int, sd: float) -> tuple[ShapePoint, ...]:
    if not np.isfinite(sd):
        return ()
    return tuple(
        ShapePoint(x_m, float(here[plane]), float(here[1 - plane]), sd)
        for x_m, here in zip(PLACES_M, shape, strict=True)
    )


def scan_of(problem: GapProblem, hypothesis: Hypothesis) -> Scan:
    """Return the scan of an effect beside the hanger alone, and cut its prior by it."""
    before = fit_alone(problem, np.random.default_rng(1))
    linear = Linear(problem.likelihood(Hypothesis()), before.slopes)
    found = scan(problem, before, linear, hypothesis)
    if found.smallest < 1:
        problem.smallest[hypothesis.effects[0]] = found.smallest
    return found


def fit_of(problem: GapProblem, hypothesis: Hypothesis, draws: int = 400) -> Fit:
    """Return the sampled fit of no effect, or of one from where a scan of it leads."""
    before = fit_alone(problem, np.random.default_rng(1))
    if not hypothesis.effects:
        return before
    starts = scan_of(problem, hypothesis).starts(problem, before)
    target = Target(problem, hypothesis)
    sampling = Sampling(target, find_peaks(target, starts), np.random.default_rng(1), before)
    sampling.run(ENOUGH_EFFECTIVE, MOST_ROUNDS)
    return sampling.fit(draws)
