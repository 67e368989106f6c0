"""Simulated years of a hanger: its modal tests, and what happened to it.

Finite elements with shear and a section that varies along the bar, of `shm.simulate`: they share no
code with the models of the watch, which know of neither.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from shm.simulate import Deviations, HangerState, drawn_hanger
from shm.values import NAN, PLANES, BoolArray, End, FloatArray, Hanger, ModalTest, Mode, Plane
from tests.benchmarks.drift.climate import (
    DAYS_A_YEAR,
    MEAN_C,
    days_of_tests,
    temperatures_c,
    time_of,
)
from tests.benchmarks.drift.frequencies import Surface, surface
from tests.benchmarks.drift.scenarios import Scenario

MODES = 6
SOUND_TESTS = 10
_SPRING_DECADES, _PLANES_APART = (-0.1, 0.9), 0.1
_DEVIATION_SD, _WAVE_SD, _WAVES = 0.003, 0.0007, 4
_TENSION_PER_K, _MODULUS_PER_K = (0.0005, 0.001), -0.0003
_TENSION_SCATTER = 0.003
_NOISE, _NOISE_BY_MODE, _NOISE_BY_TEST, _SD_FREEDOM = (1e-4, 5e-4), 0.3, 0.3, 20
_CORRELATION, _MERGED = 0.3, 0.004
_BLUNDER, _NO_TEMPERATURE, _TEMPERATURE_SD_K = 0.015, 0.03, 0.5
_MODE_MISSED, _ONE_PLANE_ONLY = 0.06, 0.03
_BEGINS_YEARS, _FOLLOWED_YEARS = (1.5, 3.0), 2.0
_ENDS: tuple[End, End] = ("deck", "arch")


@dataclass(frozen=True, eq=False)
class SimulatedHanger:
    """The truth of one hanger. `end` and `plane` are where a spring gives way, if one does.

    `tension_per_k` is a fraction; `noise_sd` (planes, modes) that of frequencies, a fraction;
    `began_day` counts from the beginning of the years.
    """

    seed: int
    hanger: Hanger
    state: HangerState
    deviations: Deviations
    intact: Surface
    tension_per_k: float
    noise_sd: FloatArray
    end: End
    plane: Plane
    began_day: float

    @property
    def began(self) -> datetime:
        return time_of(self.began_day)


@dataclass(frozen=True, eq=False)
class Years:
    """The modal tests (tests,) of a scenario, and which of them are blunders."""

    tests: tuple[ModalTest, ...]
    blunders: BoolArray


def simulated_hanger(seed: int) -> SimulatedHanger:
    """The same seed gives the same hanger."""
    rng = np.random.default_rng([seed, 0])
    hanger, state = drawn_hanger(rng, number=seed)
    state = _on_springs(hanger, state, rng)
    section, density, length, modulus = (_DEVIATION_SD * rng.standard_normal(4)).tolist()
    waves = tuple((_WAVE_SD * rng.standard_normal(_WAVES)).tolist())
    deviations = Deviations(section, density, length, modulus, waves)
    noise = np.exp(rng.uniform(*np.log(_NOISE)))
    return SimulatedHanger(
        seed=seed,
        hanger=hanger,
        state=state,
        deviations=deviations,
        intact=surface(hanger, state, deviations, MODES + 1),
        tension_per_k=float(rng.uniform(*_TENSION_PER_K) * rng.standard_normal()),
        noise_sd=noise * np.exp(_NOISE_BY_MODE * rng.standard_normal((2, MODES))),
        end=_ENDS[rng.integers(2)],
        plane=PLANES[rng.integers(2)],
        began_day=float(rng.uniform(*_BEGINS_YEARS)) * DAYS_A_YEAR,
    )


def _on_springs(hanger: Hanger, state: HangerState, rng: np.random.Generator) -> HangerState:
    """Springs of the order of what bends against them, so that the ends matter."""
    bending = hanger.bending_stiffness_n_m2
    wave_number = np.sqrt(state.tension_n / bending + (np.pi / hanger.length_m) ** 2)
    decades = rng.uniform(*_SPRING_DECADES, (2, 1)) + _PLANES_APART * rng.standard_normal((2, 2))
    deck, arch = bending * wave_number * 10**decades
    return replace(
        state,
        k1_n_m_rad=float(deck[0]), k2_n_m_rad=float(deck[1]),
        k3_n_m_rad=float(arch[0]), k4_n_m_rad=float(arch[1]),
    )  # fmt: skip


def damaged(simulated: SimulatedHanger, scenario: Scenario) -> Surface:
    """The frequencies after a spring has given way; those before where none does."""
    if not scenario.spring_loss:
        return simulated.intact
    planes = PLANES if scenario.kind == "both planes" else (simulated.plane,)
    names = [f"{spring_name(simulated.end, plane)}_n_m_rad" for plane in planes]
    state, left = simulated.state, 1 - scenario.spring_loss
    state = replace(state, **{name: left * getattr(state, name) for name in names})
    return surface(simulated.hanger, state, simulated.deviations, MODES + 1)


def spring_name(end: End, plane: Plane) -> str:
    """`k1` to `k4`: k1 and k2 at the deck, k3 and k4 at the arch; k1 and k3 act transversely."""
    return f"k{1 + 2 * _ENDS.index(end) + PLANES.index(plane)}"


def years_of(simulated: SimulatedHanger, scenario: Scenario, years: float) -> Years:
    """All tests; those with a change end two years after it.

    Times, weather and noise are those of every other scenario of the hanger.
    """
    rng = np.random.default_rng([simulated.seed, 1])
    days = days_of_tests(years, rng)
    warmth = temperatures_c(days, scenario.season_k, rng)
    log_tension = simulated.tension_per_k * (warmth - MEAN_C)
    log_tension += _TENSION_SCATTER * rng.standard_normal(len(days))
    log_tension += _shift(days - simulated.began_day, scenario)
    log_modulus = _MODULUS_PER_K * (warmth - MEAN_C)
    before = simulated.intact.log_frequency(log_tension, log_modulus)
    after = damaged(simulated, scenario).log_frequency(log_tension, log_modulus)
    changed = (days > simulated.began_day)[:, None, None]
    exact = np.where(changed, after, before)
    blunders = (rng.random(len(days)) < _BLUNDER) & (np.arange(len(days)) >= SOUND_TESTS)
    for n in range(len(days)):
        mistaken = _mistaken(exact[n], rng)
        exact[n] = mistaken if blunders[n] else exact[n]
    said = np.where(rng.random(len(days)) < _NO_TEMPERATURE, NAN, warmth)
    said = said + _TEMPERATURE_SD_K * rng.standard_normal(len(days))
    tests = _identified(simulated, exact[:, :, :MODES], days, said, rng)
    last_day = simulated.began_day + _FOLLOWED_YEARS * DAYS_A_YEAR
    told = int(np.searchsorted(days, last_day)) if scenario.changes else len(days)
    return Years(tests[:told], blunders[:told])


def _shift(since_days: FloatArray, scenario: Scenario) -> FloatArray:
    """Of the log tension (tests,)."""
    since = np.maximum(since_days, 0.0) / DAYS_A_YEAR
    level = np.where(since > 0, 1 + scenario.step, 1.0)
    return np.asarray(np.log(np.maximum(level + scenario.ramp_per_year * since, 0.5)))


def _mistaken(exact: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Log frequencies (planes, modes) of a test gone wrong, in one of three ways."""
    way, sign = rng.integers(3), rng.choice([-1.0, 1.0])
    plane, order = rng.integers(2), rng.integers(MODES)
    wrong = exact.copy()
    if way == 0:  # the next hanger: shorter or longer, with a tension of its own
        stiffened = np.linspace(1.0, 2.0, exact.shape[1])
        wrong += sign * rng.uniform(0.02, 0.08) * stiffened + 0.02 * rng.standard_normal()
    elif way == 1:  # one mode taken for the next
        wrong[plane, order] = exact[plane, order + 1]
    else:  # the logger's clock
        wrong += np.log(1 + 0.02 * sign)
    return wrong


def _identified(
    simulated: SimulatedHanger,
    exact: FloatArray,
    days: FloatArray,
    said_c: FloatArray,
    rng: np.random.Generator,
) -> tuple[ModalTest, ...]:
    """Modal tests of exact log frequencies (tests, planes, modes)."""
    of_test = np.exp(_NOISE_BY_TEST * rng.standard_normal((len(days), 1, 1)))
    sd = simulated.noise_sd * of_test
    log_frequency = exact + sd * _correlated(np.exp(exact), rng)
    stated = sd * np.sqrt(rng.chisquare(_SD_FREEDOM, sd.shape) / _SD_FREEDOM)
    missed = rng.random(sd.shape) < _MODE_MISSED
    lone = rng.random(len(days)) < _ONE_PLANE_ONLY
    missed[np.arange(len(days)), rng.integers(2, size=len(days))] |= lone[:, None]
    return tuple(
        ModalTest(
            id=f"t{n + 1}",
            modes=_modes(np.exp(log_frequency[n]), stated[n], missed[n]),
            hanger=simulated.hanger.id,
            time=time_of(days[n]),
            temperature_c=float(said_c[n]),
        )
        for n in range(len(days))
    )


def _correlated(frequency_hz: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Standard normal errors (tests, planes, modes), alike where two planes' peaks overlap."""
    first, second = frequency_hz[:, 0], frequency_hz[:, 1]
    apart = (first - second) / (_MERGED * first)
    rho = _CORRELATION / (1 + apart**2)
    errors = rng.standard_normal(frequency_hz.shape)
    errors[:, 1] = rho * errors[:, 0] + np.sqrt(1 - rho**2) * errors[:, 1]
    return np.asarray(errors)


def _modes(frequency_hz: FloatArray, sd: FloatArray, missed: BoolArray) -> tuple[Mode, ...]:
    return tuple(
        Mode(
            plane,
            order + 1,
            float(frequency_hz[number, order]),
            float(frequency_hz[number, order] * sd[number, order]),
        )
        for number, plane in enumerate(PLANES)
        for order in range(MODES)
        if not missed[number, order]
    )
