"""Simulators of three textbook systems with catalogues of effects, as a user would write them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from shm.gap.simulator.simulator_problem import Condition, Prior, Simulator, SimulatorEffect

Values = dict[str, Any]
GAIN = {"gain": Prior("normal", 1.0, 0.01)}


def _two_frequencies(a: Any, b: Any, c: Any, mass: tuple[Any, Any]) -> tuple[Any, Any]:
    """Of a flexibility matrix [[a, b], [b, c]] with two masses, in Hz, the lower one first."""
    trace = a * mass[0] + c * mass[1]
    root = np.sqrt(trace**2 - 4 * (a * c - b**2) * mass[0] * mass[1])
    return tuple(((trace + s * root) / 2) ** -0.5 / (2 * np.pi) for s in (1, -1))


def _frame(p: Values, at: Condition) -> Mapping[str, Any]:
    load, warm = at["load_n"], at["temperature_k"]
    soft = 1 + p.get("per_kelvin", 0.0) * warm
    base = p.get("base_rad_n_m", 0.0)
    one, two = soft / p["k1_n_m"], soft / p["k2_n_m"]
    f11, f12, f22 = one + 9 * base, one + 18 * base, one + two + 36 * base
    masses = 4000.0 + 0 * one, 3000.0 + p.get("mass_kg", 0.0)
    f1, f2 = _two_frequencies(f11, f12, f22, masses)
    on_roof = at["floor"] == 2
    u1, u2 = load * (f12 if on_roof else f11), load * (f22 if on_roof else f12)
    shift = p.get("play_m", 0.0) * np.tanh(load / p.get("closing_n", 1.0))
    if load:
        shift = shift + p.get("bearing_m_n", 0.0) * load
    hard = 1 - p.get("hardening", 0.0) * (load / 16e3) ** 2
    u1, u2 = (u1 * hard + shift) * p["gain"], (u2 * hard + shift) * p["gain"]
    return {"u1_m": u1, "u2_m": u2, "f1_hz": f1, "f2_hz": f2}


def _effect(name: str, predict: Any, **parameters: Prior) -> SimulatorEffect:
    return SimulatorEffect(name, parameters, predict)


FRAME = Simulator(
    _frame,
    {
        "k1_n_m": Prior("lognormal", 6e6, 0.1),
        "k2_n_m": Prior("lognormal", 4e6, 0.1),
        **GAIN,
    },
    (
        _effect(
            "loose_joint",
            _frame,
            play_m=Prior("logarithmic", 2e-5, 2e-3),
            closing_n=Prior("logarithmic", 300.0, 5e3),
            bearing_m_n=Prior("logarithmic", 1e-11, 1e-8),
        ),
        _effect("base_turns", _frame, base_rad_n_m=Prior("logarithmic", 1e-10, 1e-8)),
        _effect("roof_mass", _frame, mass_kg=Prior("logarithmic", 20.0, 1000.0)),
        _effect("hardening", _frame, hardening=Prior("logarithmic", 5e-3, 0.3)),
        _effect("warm_softening", _frame, per_kelvin=Prior("logarithmic", 5e-5, 5e-3)),
    ),
    vectorised=True,
)

_LENGTH, _MASS = 4.0, 60.0
_ROOTS = (1.8751040687, 4.6940911330)


_PLACES = (np.arange(24) + 0.5) / 24


def _flexibility(x: Any, a: Any, ei: Any, p: Values) -> Any:
    """Deflection at x by 1 N at a of an Euler cantilever, its support and a crack."""
    low, high = np.minimum(x, a), np.maximum(x, a)
    bent = low**2 * (3 * high - low) / (6 * ei)
    crack = p.get("crack_at_m", 2.0)
    bent = bent + p.get("crack_rad_n_m", 0.0) * np.maximum(x - crack, 0) * np.maximum(a - crack, 0)
    return bent + p.get("support_m_n", 0.0) + p.get("clamp_rad_n_m", 0.0) * x * a


def _cantilever(p: Values, at: Condition) -> Mapping[str, Any]:
    ei, load, a = p["ei_n_m2"], at["load_n"], at["load_at_m"]
    if load:
        shares = (0.25, 0.5, 0.75, 1.0)
        hard = 1 - p.get("hardening", 0.0) * (load / 2e3) ** 2
        return {
            f"w{int(100 * s)}_m": load * _flexibility(s * _LENGTH, a, ei, p) * hard * p["gain"]
            for s in shares
        }
    column = {name: np.asarray(value)[..., None, None] for name, value in p.items()}
    places = _PLACES * _LENGTH
    shape = _flexibility(places[:, None], places, column["ei_n_m2"], column)
    mass = np.broadcast_to(_MASS * _LENGTH / 24, (*np.shape(ei), 24)).copy()
    mass[..., -1] += p.get("tip_mass_kg", 0.0)
    root = np.sqrt(mass)
    values = np.linalg.eigvalsh(shape * root[..., :, None] * root[..., None, :])
    return {f"f{i}_hz": values[..., -i] ** -0.5 / (2 * np.pi) for i in (1, 2)}


CANTILEVER = Simulator(
    _cantilever,
    {"ei_n_m2": Prior("lognormal", 2e6, 0.1), **GAIN},
    (
        _effect("support_moves", _cantilever, support_m_n=Prior("logarithmic", 1e-8, 3e-6)),
        _effect("clamp_turns", _cantilever, clamp_rad_n_m=Prior("logarithmic", 1e-9, 1e-6)),
        _effect("tip_mass", _cantilever, tip_mass_kg=Prior("logarithmic", 0.3, 60.0)),
        _effect(
            "crack",
            _cantilever,
            crack_rad_n_m=Prior("logarithmic", 1e-9, 1e-6),
            crack_at_m=Prior("uniform", 0.4, 3.6),
        ),
        _effect("hardening", _cantilever, hardening=Prior("logarithmic", 5e-3, 0.3)),
    ),
    vectorised=True,
)


def _oscillator(p: Values, at: Condition) -> Mapping[str, Any]:
    """Harmonic balance: what is not linear counts by its first harmonic at the amplitude found."""
    w, force = 2 * np.pi * at["frequency_hz"], at["force_n"]
    m1, m2 = 10.0, 5.0 + p.get("mass_kg", 0.0)
    x1 = np.full(np.shape(p["k1_n_m"]), force / 8000.0)
    for _ in range(_ROUNDS if set(p) & _NOT_LINEAR else 1):
        c1 = p["c1_n_s_m"] + 4 * p.get("friction_n", 0.0) / (np.pi * w * x1)
        c1 = c1 + 8 / (3 * np.pi) * p.get("drag_n_s2_m2", 0.0) * w * x1
        k1 = p["k1_n_m"] + 0.75 * p.get("cubic_n_m3", 0.0) * x1**2
        k1 = k1 + p.get("magnet_n_m_per_hz", 0.0) * at["frequency_hz"]
        link = p["k2_n_m"] + 1j * w * p["c2_n_s_m"]
        second = link / (link - m2 * w**2)
        found = force / (k1 + 1j * w * c1 - m1 * w**2 + link * (1 - second))
        x1 = (x1 + np.abs(found)) / 2 if set(p) & _NOT_LINEAR else np.abs(found)
    return {"x1_m": x1 * p["gain"], "x2_m": x1 * np.abs(second) * p["gain"]}


_ROUNDS = 16
_NOT_LINEAR = {"friction_n", "drag_n_s2_m2", "cubic_n_m3"}

OSCILLATOR = Simulator(
    _oscillator,
    {
        "k1_n_m": Prior("lognormal", 8000.0, 0.1),
        "k2_n_m": Prior("lognormal", 3000.0, 0.1),
        "c1_n_s_m": Prior("lognormal", 25.0, 0.3),
        "c2_n_s_m": Prior("lognormal", 15.0, 0.3),
        **GAIN,
    },
    (
        _effect("friction", _oscillator, friction_n=Prior("logarithmic", 0.05, 10.0)),
        _effect("cubic_spring", _oscillator, cubic_n_m3=Prior("logarithmic", 1e5, 3e7)),
        _effect("drag", _oscillator, drag_n_s2_m2=Prior("logarithmic", 1.0, 300.0)),
        _effect("second_mass", _oscillator, mass_kg=Prior("logarithmic", 0.02, 1.0)),
        _effect("magnet", _oscillator, magnet_n_m_per_hz=Prior("logarithmic", 3.0, 300.0)),
    ),
    vectorised=True,
)
