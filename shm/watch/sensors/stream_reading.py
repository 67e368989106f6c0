"""Read a pooled hour of a permanent sensor: how far the tension has moved, by each plane's modes.

The change of each mode's log frequency over its sensitivity d ln f / d ln T is a change of tension;
the modes of a plane give it by robust weighted least squares. What a mode differs by from the
others of its plane is learnt; what a complete plane differs by is the reading's contrast.

Frequencies of a bar on springs are homogeneous of degree 1/2 in tension, bending stiffness and
springs. So what a kelvin does by softening steel is -3e-4 (1/2 - d ln f / d ln T).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shm.assumptions import DEFAULTS, Assumptions
from shm.models import class_of
from shm.models.classes.tensioned_beam import frequencies_hz
from shm.values import PLANES, BoolArray, FloatArray, Hanger, Mode, Posterior
from shm.values.stream import PooledReading
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.quantities import MeasuredMode, base_point, log_frequencies, posterior_at

_HALVES = np.array([0.5, -0.5])  # by definition: of a contrast, in each of PLANES
# What is tried where there is no baseline: xi = L sqrt(T/EI) from slack to a slender cable, springs
# k L/EI from pinned to clamped, and the share of the solid stiffness that a strand may have.
_XI = np.geomspace(0.5, 300.0, 240)


def baseline_of(
    baseline: Posterior | None, hanger: Hanger, keys: Sequence[MeasuredMode], log_hz: FloatArray
) -> tuple[Posterior, Hanger]:
    """Return the baseline with its hanger; without one the beam on springs that fits best.

    That has the least sum of absolute misfits, springs by plane: a mode with a wrong order counts
    for little. The nominal tension tells a slack bar on stiff springs from a taut one on soft ones.
    """
    if baseline is not None:
        return baseline, hanger
    order = np.array([each for _, each in keys]) - 1
    assumed = hanger.assumptions
    stiffness = np.geomspace(*assumed.end_restraint.bounds, LIMITS.n_springs)
    factors = np.geomspace(*assumed.strand_bending_factor.bounds, LIMITS.n_shares)
    shares = factors if hanger.kind == "strand" else np.ones(1)
    length_m, mass = np.asarray(hanger.length_m), np.asarray(hanger.mass_per_length_kg_m)
    xi, k, share = np.meshgrid(_XI, stiffness, shares, indexing="ij")
    bending = hanger.bending_stiffness_n_m2 * share
    tension_n, spring = bending * (xi / length_m) ** 2, k * bending / length_m
    modes = frequencies_hz(length_m, tension_n, bending, mass, spring, spring, order.max() + 1)
    misfit = np.abs(np.log(modes[..., order]) - log_hz)
    by_plane = {plane: misfit[..., its].sum(axis=-1) for plane, its in planes_of(keys).items()}
    total = sum(each.min(axis=1) for each in by_plane.values())
    if hanger.nominal_tension_n > 0:
        total = total + LIMITS.nominal * np.abs(np.log(tension_n[:, 0] / hanger.nominal_tension_n))
    at, of = np.unravel_index(int(np.argmin(total)), total.shape)
    found = {plane: each[at, :, of].argmin() for plane, each in by_plane.items()}
    across, along = (found.get(each, next(iter(found.values()))) for each in PLANES)
    ends = np.log10(spring[at, [across, along, across, along], of])
    nominal_n = hanger.nominal_tension_n if hanger.nominal_tension_n > 0 else 1.0
    theta = np.array([tension_n[at, 0, of] / nominal_n, 1.0, *ends])
    factor = hanger.bending_stiffness_factor * float(shares[of])
    bar = replace(hanger, bending_stiffness_factor=factor, nominal_tension_n=nominal_n)
    names = ("theta_F", "theta_L", "log10_k1", "log10_k2", "log10_k3", "log10_k4")
    return posterior_at("beam2", bar, dict(zip(names, theta.tolist(), strict=True))), bar


@dataclass(frozen=True, eq=False)
class ModeTable:
    """The n modes of a stream, as far as learnt: `level` is ln f where the tension has not moved.

    `spread` is the variance by which a mode differs from the others, `readings` of how many.
    """

    modes: tuple[MeasuredMode, ...]
    tension: FloatArray
    level: FloatArray
    spread: FloatArray
    readings: FloatArray
    tension_n: float

    @classmethod
    def of(cls, baseline: Posterior | None, hanger: Hanger, modes: Sequence[Mode]) -> ModeTable:
        keys = tuple((mode.plane, mode.order) for mode in modes)
        level, sd = _measured(modes, hanger.assumptions)
        posterior, bar = baseline_of(baseline, hanger, keys, level)
        model = class_of(posterior, bar)
        theta = np.tile(base_point(posterior, model), (2, 1))
        theta[:, model.parameter_names.index("theta_F")] *= np.exp(
            [LIMITS.stream_reading_step, -LIMITS.stream_reading_step]
        )
        up, down = log_frequencies(model, theta, keys)
        tension_n = float(posterior.tension_n.mean())
        return cls(
            keys,
            (up - down) / (2 * LIMITS.stream_reading_step),
            level,
            sd**2,
            np.zeros(len(keys)),
            tension_n,
        )

    def with_new(
        self,
        baseline: Posterior | None,
        hanger: Hanger,
        modes: Sequence[Mode],
        shift: float,
        contrast: float = 0.0,
    ) -> ModeTable:
        """With modes that were not seen before, at a tension moved by `shift`, planes apart."""
        new = [mode for mode in modes if (mode.plane, mode.order) not in self.modes]
        if not new:
            return self
        more = ModeTable.of(baseline, hanger, new)
        parts: dict[str, Any] = {
            name: np.append(getattr(self, name), getattr(more, name))
            for name in ("tension", "spread", "readings")
        }
        by_plane = dict(zip(PLANES, shift + contrast * _HALVES, strict=True))
        moved = more.tension * [by_plane[mode.plane] for mode in new]
        level = np.append(self.level, more.level - moved)
        return replace(self, modes=(*self.modes, *more.modes), level=level, **parts)

    def softer(self, assumed: Assumptions) -> FloatArray:
        """Return by what ln f goes with a kelvin, as steel softens."""
        return np.asarray(assumed.modulus_per_kelvin.value * (0.5 - self.tension))

    def seen(
        self,
        modes: Sequence[Mode],
        warmth_k: float,
        assumed: Assumptions = DEFAULTS,
        expected: tuple[float, float] = (0.0, 0.0),
    ) -> SeenReading:
        """A reading in the places of the table's modes, NaN where it lacks one.

        `expected` is the contrast between the planes by the readings before, with its sd.
        """
        off, variance = np.full(len(self.modes), np.nan), np.full(len(self.modes), np.inf)
        its = [self.modes.index((mode.plane, mode.order)) for mode in modes]
        log_hz, sd = _measured(modes, assumed)
        off[its] = log_hz - self.level[its] - warmth_k * self.softer(assumed)[its]
        variance[its] = np.maximum(sd**2, self.spread[its])
        return _read(off, variance, self.tension, planes_of(self.modes), expected)

    def learnt(self, seen: SeenReading) -> ModeTable:
        """With what a reading adds to each mode's level and spread.

        What is left over once each plane's shift is taken off adds up to 0 in the direction of a
        tension: the levels can take up neither what the tension does nor what one plane does.
        """
        known = np.isfinite(seen.left)
        readings = self.readings + known
        share = np.where(
            known, 1 / np.minimum(np.maximum(readings, 1), LIMITS.memory_readings), 0.0
        )
        sd = np.sqrt(self.spread)
        left = np.clip(np.where(known, seen.left, 0.0), -LIMITS.clip * sd, LIMITS.clip * sd)
        spread = self.spread + share * (left**2 - self.spread)
        return replace(
            self,
            readings=readings,
            level=self.level + share * left,
            spread=np.maximum(spread, LIMITS.least_sd**2),
        )


@dataclass(frozen=True, eq=False)
class SeenReading:
    """`shift` of ln T by one reading with its variance; `left` (n,) of each mode, NaN if lacking.

    `off` (n,) are the modes' own changes of ln f, warmth of steel taken off. `contrast` is what the
    modes of the first plane say of ln T less what those of the other do; NaN without either plane.
    `by_plane` is what each plane says of the shift, as much apart as expected.
    """

    shift: float
    variance: float
    off: FloatArray
    left: FloatArray
    by_plane: FloatArray
    contrast: float = math.nan
    contrast_variance: float = math.inf


def usable(reading: PooledReading) -> tuple[Mode, ...]:
    """Return the modes that say something of the tension, each once."""
    found: dict[MeasuredMode, Mode] = {}
    for mode in reading.modes:
        is_measured = np.isfinite(mode.frequency_hz) and mode.frequency_hz > 0
        if is_measured and not mode.irregular and not np.isinf(mode.frequency_sd_hz):
            found.setdefault((mode.plane, mode.order), mode)
    return tuple(found.values())


def _measured(
    modes: Sequence[Mode], assumed: Assumptions = DEFAULTS
) -> tuple[FloatArray, FloatArray]:
    unstated = assumed.unstated_frequency_sd.value
    hz = np.array([mode.frequency_hz for mode in modes])
    sd = np.array([mode.frequency_sd_hz for mode in modes]) / hz
    return np.log(hz), np.where(sd > 0, np.maximum(sd, LIMITS.least_sd), unstated)


def _read(
    off: FloatArray,
    variance: FloatArray,
    slope: FloatArray,
    planes: Mapping[str, BoolArray],
    expected: tuple[float, float],
) -> SeenReading:
    """Read each plane by itself; where planes disagree by more than expected, the errors grow."""
    left = np.full(len(off), np.nan)
    shift, its = np.zeros(len(PLANES)), np.full(len(PLANES), np.inf)
    for place, plane in enumerate(PLANES):
        seen = np.isfinite(off) & planes.get(plane, np.zeros(len(off), bool))
        if seen.any():
            shift[place], its[place] = _read_plane(off[seen], variance[seen], slope[seen])
            left[seen] = off[seen] - slope[seen] * shift[place]
    weight = (1 / its) / (1 / its).sum()
    by_plane = np.where(np.isfinite(its), shift - expected[0] * _HALVES, np.nan)
    mean = float(weight @ np.nan_to_num(by_plane))
    total = 1 / float((1 / its).sum()) + (float(weight @ _HALVES) * expected[1]) ** 2
    if not np.isfinite(its).all():
        return SeenReading(mean, total, off, left, by_plane)
    contrast = float(shift[0] - shift[1])
    both = float(its.sum())
    misfit = (contrast - expected[0]) ** 2 / (both + expected[1] ** 2)
    return SeenReading(mean, total * max(misfit, 1.0), off, left, by_plane, contrast, both)


def _read_plane(y: FloatArray, v: FloatArray, s: FloatArray) -> tuple[float, float]:
    """Reweighted least squares from the weighted median on; errors grow where the modes differ."""
    shift = _weighted_median(y / s, s / np.sqrt(v))
    # Technical: of reweighting, from the weighted median on
    for _ in range(4):
        weight = (LIMITS.degrees + 1) / (LIMITS.degrees + (y - s * shift) ** 2 / v) / v
        weight = np.minimum(weight, 1 / v)  # no mode is better than it says
        information = float(weight @ s**2)
        shift = float(weight @ (s * y)) / information
    misfit = float(weight @ (y - s * shift) ** 2) / max(len(y) - 1, 1)
    return shift, max(misfit, 1.0) / information


def _weighted_median(values: FloatArray, weight: FloatArray) -> float:
    order = np.argsort(values)
    share = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(share, share[-1] / 2)])


def planes_of(modes: Sequence[MeasuredMode]) -> dict[str, BoolArray]:
    """Return which modes (n,) are of each plane, for the planes that have any."""
    found = [plane for plane, _ in modes]
    return {plane: np.array([each == plane for each in found]) for plane in dict.fromkeys(found)}
