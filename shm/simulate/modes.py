"""Modes of a hanger in a state, by the general model of `shm.models`, as responses need them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import UsageError
from shm.models.classes.end_effects import coupled_bar
from shm.models.hanger import NormalModes, PhysicalHanger, normal_modes
from shm.simulate.state import HangerState
from shm.values import PLANES, FloatArray, Hanger

_MORE = 1.25  # times as many modes, while the highest is still too low
_SOFT = 1e-9  # of EI/L: a spring that stands for a hinge changes frequencies by 2e-10
_BUCKLED = 1.01e-3
"""Of sqrt(EI/(m L^4)): a bar that buckles has no lower frequency in the general model."""


@dataclass(frozen=True, eq=False)
class ModelModes:
    """Modes of one plane of a solved hanger: see `shm.simulate.response.PlaneModes`.

    Where an end couples the planes, the modes of both stand in each; `families` are the planes
    whose modes these are, `axis` that along which they are seen, `sign` (modes,) makes the first
    lobe positive.
    """

    solved: NormalModes
    families: tuple[int, ...]
    axis: int
    sign: FloatArray
    other: ModelModes | None = None

    @property
    def angular_frequency_rad_s(self) -> FloatArray:
        """Return the angular frequencies (modes,)."""
        return self.solved.angular_frequency_rad_s[list(self.families)].ravel()

    @property
    def added_damping_ratio(self) -> FloatArray:
        """Return what joints and springs add to the damping ratio (modes,)."""
        return self.solved.damping_ratio[list(self.families)].ravel()

    def at(self, x_m: FloatArray) -> FloatArray:
        """Return the mode shapes in kg^-1/2 at `x_m` (points,): (points, modes)."""
        moved = self.solved.deflections(x_m)[list(self.families), self.axis]
        return np.asarray(np.concatenate(list(moved), axis=-1) * self.sign)


def make_bar(hanger: Hanger, state: HangerState, sensors: int = 0) -> PhysicalHanger:
    """Return the bar of a hanger in a state, with its turnbuckles and no effect."""
    tension_n = np.array([state.tension_n])
    bar = coupled_bar(hanger, np.array([state.effective_length_m(hanger)]), tension_n)
    springs = np.array([state.springs_n_m_rad(plane) for plane in PLANES]).T  # (ends, planes)
    hinge = _SOFT * hanger.bending_stiffness_n_m2 / hanger.length_m
    springs = np.maximum(springs, hinge)
    bar = bar.on_springs((springs[:1], springs[1:]))
    return replace(bar, sensor_turn_rad=np.zeros((1, sensors)))


def plane_modes(bar: PhysicalHanger, frequency_hz: float) -> tuple[ModelModes, ModelModes]:
    """Return at least all modes below a frequency of each plane.

    Raises UsageError where a compression buckles the bar.
    """
    count = _estimate_count(bar, frequency_hz)
    solved = normal_modes(bar, count)
    while solved.angular_frequency_rad_s[:, -1].min() < 2 * math.pi * frequency_hz:
        count = int(_MORE * count) + 1
        solved = normal_modes(bar, count)
    _refuse_buckled(solved, bar)
    sign = _signs(solved, bar, count)
    if not bool(np.any(bar.rotational_compliance_rad_n_m[..., 0, 1])):
        return ModelModes(solved, (0,), 0, sign[0]), ModelModes(solved, (1,), 1, sign[1])
    across, along = (ModelModes(solved, (0, 1), axis, sign.ravel()) for axis in (0, 1))
    return replace(across, other=along), replace(along, other=across)


def _estimate_count(bar: PhysicalHanger, frequency_hz: float) -> int:
    """Return about how many modes lie below a frequency: those of the pinned bar.

    f_n = n/(2L) sqrt(T/m) sqrt(1 + n^2 pi^2 EI/(T L^2)); end springs only raise it.
    """
    bending, tension = float(bar.bending_stiffness_n_m2.min()), float(bar.tension_n[0])
    sought = float(bar.mass_per_length_kg_m[0]) * (2 * math.pi * frequency_hz) ** 2
    root = math.sqrt(tension**2 + 4 * bending * sought)
    wave_number = math.sqrt((root - tension) / (2 * bending))
    return math.ceil(wave_number * float(bar.length_m[0]) / math.pi) + 1


def _signs(solved: NormalModes, bar: PhysicalHanger, count: int) -> FloatArray:
    """Return the sign of each mode in its first lobe, (planes, modes)."""
    x_m = bar.deck_end_m + bar.length_m / (4 * count)
    moved = solved.deflections(x_m)[:, :, 0]
    return np.where(np.array([moved[0, 0], moved[1, 1]]) < 0, -1.0, 1.0)


def _refuse_buckled(solved: NormalModes, bar: PhysicalHanger) -> None:
    inertia = bar.mass_per_length_kg_m[0] * bar.length_m[0] ** 4
    unit = np.sqrt(bar.bending_stiffness_n_m2.max() / inertia)
    if solved.angular_frequency_rad_s.min() < _BUCKLED * unit:
        raise UsageError(
            "the compression buckles the hanger: it has no lowest frequency.",
            remedy="Give a larger tension.",
        )
