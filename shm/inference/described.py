"""The sampler's space for the bar as made: what frequencies see, and what they never tell.

Of the parameters of `shm.models.as_made` frequencies see the apparent tension a = T/(mu l^2) and a
few combinations of the deviations: c = sqrt(e/mu)/l^2 always, the area where the class shears, the
mass per length where a known mass was clamped on. Only these are sampled. What is left of the
deviations, and springs of planes that were not measured, is drawn from the prior afterwards, given
what a measured tension says of it: exactly, at no cost. That draw is what makes the tension's
interval absolute.

Priors: the tension is about as designed, or its logarithm is uniform, as are log10 k L/EI;
deviations are normal with the standard deviations of the description, or as an earlier measured
tension has calibrated them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.inference.coordinates import Coordinates, log_normal
from shm.inference.priors import (
    DEVIATIONS,
    Calibration,
    Deviations,
    EndDetails,
    TensionPrior,
    reading_of,
)
from shm.models.as_made import (
    BENDING,
    DENSITY,
    LENGTH,
    MODULUS,
    SECTION,
    SHEAR,
    TENSION,
    AsMade,
)
from shm.models.beam import Beam, Beam3
from shm.values import PLANES, FloatArray, IntArray, ModalTest, Plane, Prior

# c = sqrt(e/mu)/l^2 with e ~ modulus section^2 and mu ~ density section.
_C = {SECTION: 0.5, DENSITY: -0.5, MODULUS: 0.5, LENGTH: -2.0, BENDING: 0.5}
_MASS = {SECTION: 1.0, DENSITY: 1.0, LENGTH: 2.0}
"""ln c and ln(mu l^2) by the deviations."""

_WIDER = (0.9, 1.15)
"""Numerical: the range of a strand's factor, widened by what tolerances and length do to c."""

_MOST_REDRAWN = 20  # a factor that is inside in half of its draws is left outside by 1e-6 of them


class DescribedCoordinates:
    """Places z (n, d) of parameters theta (n, parameters) of a bar as made.

    First those of a box (`shm.inference.coordinates`): log tension, a length that plates leave
    open, springs of the planes measured, a strand's bending factor and shear; then the deviations
    as far as they are seen, the last of them ln c. `wave_stiffness_n_m_rad` is EI p of a mode in
    the middle of those measured. Of a strand whose factor is open, the factor takes all of c.
    """

    def __init__(
        self,
        model: AsMade,
        tests: Sequence[ModalTest],
        wave_stiffness_n_m_rad: float,
        calibration: Calibration | None = None,
    ):
        self.model, self._hanger = model, model.hanger
        self.names = model.parameter_names
        self.deviations = own = Deviations(model, calibration)
        self._slips = model.is_strand and BENDING not in own.names
        self._open = model.length_is_open
        planes = {mode.plane for test in tests for mode in test.regular_modes}
        self._felt = tuple(n for n in model.springs if _is_felt(model, n, planes))
        self.box = self._box()
        swaps = [pair for pair in model.swaps if set(pair) <= set(self._felt)]
        self._inner = Coordinates(self.box, swaps, wave_stiffness_n_m_rad)
        round_ = isinstance(model.model, Beam) and self._hanger.plate is None
        assumed = model.hanger.assumptions
        self._details = EndDetails(
            self.box.names, model.springs, round_, bool(model.swaps), assumed
        )
        self._tension = TensionPrior(model.bounds[TENSION], assumed)
        self._reading = reading_of(tests, assumed)
        others = []
        if isinstance(model.model, Beam3) and not model.is_strand:
            others.append(own.row(section=1.0))
        if any(test.added_mass is not None for test in tests):
            others.append(own.row(section=1.0, density=1.0, theta_L=1.0))
        seen = [] if self._slips else [own.row(**_C)]
        self._seen = _basis(np.array([*others, *seen]).reshape(-1, len(own.names)))
        self.dimension = len(self.box.names) + self._seen.shape[1]

    def _box(self) -> Prior:
        bounds = {TENSION: tuple(np.log(self.model.bounds[TENSION]))}
        if self._open:
            bounds[LENGTH] = self.model.bounds[LENGTH]
        bounds |= {name: self.model.bounds[name] for name in self._felt}
        if self._slips:
            low, high = self.model.bounds[BENDING]
            bounds[BENDING] = (_WIDER[0] * low, _WIDER[1] * high)
        if SHEAR in self.names:
            bounds[SHEAR] = self.model.bounds[SHEAR]
        lower, upper = np.array(list(bounds.values()), dtype=float).T
        return Prior(tuple(bounds), lower, upper)

    @property
    def felt_springs(self) -> tuple[str, ...]:
        """End springs of a beam in the planes measured."""
        return self._felt if isinstance(self.model.model, Beam) else ()

    def springs_alike(self, restraint: float) -> dict[str, float]:
        """The springs felt where k L/EI of all ends is `restraint`."""
        unit = self._hanger.bending_stiffness_n_m2 / self._hanger.length_m
        return dict.fromkeys(self.felt_springs, math.log10(restraint * unit))

    # ------------------------------------------------ what is seen, and what is not

    @property
    def _row_mass(self) -> FloatArray:
        """ln(mu l^2) by n (k,): what stands between the tension and the apparent one."""
        return self.deviations.row(**_MASS)

    @property
    def _unseen_mass(self) -> FloatArray:
        return np.asarray(self._row_mass - self._seen @ (self._seen.T @ self._row_mass))

    @property
    def reading_sd(self) -> float:
        """Of a measured tension about the one predicted at the middle of what is not seen."""
        unseen = float(np.linalg.norm(self._unseen_mass))
        return math.hypot(self._reading.sd, unseen) if self._reading else math.nan

    def _drawn(
        self, inner: FloatArray, deviates: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """n (n, k) given what is seen of it (n, r), and the reading along the mass."""
        rest = rng.standard_normal((len(inner), len(self._row_mass)))
        n = (deviates - rest @ self._seen) @ self._seen.T + rest
        along = self._unseen_mass
        size = float(np.linalg.norm(along))
        if self._reading is None or size == 0:
            return np.asarray(n)
        along = along / size
        nominal = math.log(self._hanger.nominal_tension_n) + self._mean_mass
        off = math.log(self._reading.tension_n) - nominal - inner[:, 0] - n @ self._row_mass
        off = off - self._reading.sd * rng.standard_normal(len(n))
        # Matheron's rule: the prior draw moved by what the noisy reading misses it by.
        gain = size / (size**2 + self._reading.sd**2)
        return np.asarray(n + (gain * off)[:, None] * along)

    @property
    def _mean_mass(self) -> float:
        return float(sum(self.deviations.mean_of(name) * share for name, share in _MASS.items()))

    # ------------------------------------------------ places and parameters

    def theta(self, z: FloatArray) -> FloatArray:
        """Parameters (n, parameters), what is not seen at its middle."""
        inner, deviates = self._split(z)
        return self._assembled(inner, deviates @ self._seen.T, None)

    def finished(self, z: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Draws of all parameters (n, parameters): what is not seen is drawn."""
        inner, deviates = self._split(z)
        inner = self._inner.unfold(inner, rng)
        theta = self._assembled(inner, self._drawn(inner, deviates, rng), rng)
        if self._slips:
            column, (low, high) = self.names.index(BENDING), self.model.bounds[BENDING]
            for _ in range(_MOST_REDRAWN):
                out = np.flatnonzero((theta[:, column] < low) | (theta[:, column] > high))
                if not len(out):
                    break
                again = self._drawn(inner[out], deviates[out], rng)
                theta[out] = self._assembled(inner[out], again, rng)
        return theta

    def tension_n(self, z: FloatArray) -> FloatArray:
        """The tension (n,) with what is not seen at its middle."""
        return self.theta(z)[:, 0] * self._hanger.nominal_tension_n

    def _assembled(
        self, inner: FloatArray, n: FloatArray, rng: np.random.Generator | None
    ) -> FloatArray:
        """Parameters (n, parameters) of the box's and of deviates n (n, k)."""
        own, stated = self.deviations, self._hanger.bending_stiffness_factor
        deviations = own.mean + n @ own.factor.T
        section, density, modulus = (own.column(deviations, name) for name in DEVIATIONS)
        taped = np.exp(own.column(deviations, LENGTH))
        box = dict(zip(self.box.names, inner.T, strict=True))
        if self._slips:
            log_c = (section - density + modulus) / 2 - 2 * np.log(taped)
            slip = box[BENDING] * np.exp(-2 * log_c)
        else:
            slip = stated * np.exp(own.column(deviations, BENDING))
        stiffness = np.exp(2 * section + modulus) * slip / stated
        columns = {
            TENSION: np.exp(inner[:, 0] + section + density) * taped**2,
            LENGTH: box.get(LENGTH, taped),
            SECTION: section,
            DENSITY: density,
            MODULUS: modulus,
            BENDING: slip,
            SHEAR: box.get(SHEAR, slip),
        }
        for name in self.model.springs:
            low, high = self.model.bounds[name]
            known = box.get(name)
            if known is None:
                known = np.full(len(n), high) if rng is None else rng.uniform(low, high, len(n))
            columns[name] = known + np.log10(stiffness / taped)
        return np.column_stack([columns[name] for name in self.names])

    def places(self, theta: FloatArray) -> FloatArray:
        """Places (n, d), inside the fold, of parameters (n, parameters)."""
        values = dict(zip(self.names, theta.T, strict=True))
        own, stated = self.deviations, self._hanger.bending_stiffness_factor
        taped = np.ones(len(theta)) if self._open else values[LENGTH]
        slip = values.get(BENDING, np.full(len(theta), stated))
        logs = {name: values[name] for name in DEVIATIONS}
        logs |= {BENDING: np.log(slip / stated), LENGTH: np.log(taped)}
        deviations = np.column_stack(
            [logs.get(name, np.full(len(theta), own.mean_of(name))) for name in own.names]
        )
        stiffness = np.exp(2 * values[SECTION] + values[MODULUS]) * slip / stated
        mass = np.exp(values[SECTION] + values[DENSITY])
        log_c = np.log(stiffness / mass) / 2 - 2 * np.log(taped)
        box = {TENSION: np.log(values[TENSION] / (mass * taped**2)), LENGTH: values[LENGTH]}
        box |= {BENDING: stated * np.exp(2 * log_c), SHEAR: values.get(SHEAR, slip)}
        box |= {name: values[name] - np.log10(stiffness / taped) for name in self._felt}
        inner = np.column_stack([box[name] for name in self.box.names])
        inner = inner.clip(self.box.lower, self.box.upper)
        deviates = (deviations - own.mean) @ np.linalg.pinv(own.factor).T @ self._seen
        return np.hstack([self._inner.places(inner), deviates])

    def shared(self, names: Sequence[str], samples: FloatArray) -> tuple[IntArray, FloatArray]:
        """The columns of z that draws (n, parameters) of any class know, and their places there:
        the apparent tension's, and those of the deviations.
        """
        known = dict(zip(names, samples.T, strict=True))
        columns = []
        for name in self.names:
            usual = np.full(len(samples), sum(self.model.bounds[name]) / 2)
            columns.append(usual if name in self.model.springs else known.get(name, usual))
        z = self.places(np.column_stack(columns))
        kept = np.append(0, np.arange(len(self.box.names), self.dimension))
        return kept, z[:, kept]

    def fold(self, z: FloatArray) -> FloatArray:
        """`z` (n, d) with each point replaced by its copy inside the fold."""
        count = len(self.box.names)
        return np.hstack([self._inner.fold(z[:, :count]), z[:, count:]])

    def log_prior(self, z: FloatArray) -> FloatArray:
        """Log density (n,) of the folded prior at `z` (n, d); -inf outside of it."""
        count = len(self.box.names)
        log = self._inner.log_prior(z[:, :count]) + log_normal(z[:, count:])
        inside = np.isfinite(log)
        inner = self._inner.theta(z[inside, :count])
        log[inside] += self._tension.log_density(inner[:, 0])
        if len(self._details.columns) and inside.any():
            log[inside] += self._details.log_density(self._shares_of_springs(inner))
        return np.asarray(log)

    def draw_prior(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Places (n, d) from the folded prior."""
        inner = rng.uniform(self.box.lower, self.box.upper, (n, len(self.box.names)))
        inner[:, 0] = self._tension.draw(n, rng)
        columns = self._details.columns
        width = self.box.upper[columns] - self.box.lower[columns]
        inner[:, columns] = self.box.lower[columns] + width * self._details.draw(n, rng)
        return np.hstack([self._inner.places(inner), self._deviates(n, rng)])

    def _shares_of_springs(self, inner: FloatArray) -> FloatArray:
        columns = self._details.columns
        width = self.box.upper[columns] - self.box.lower[columns]
        return np.asarray((inner[:, columns] - self.box.lower[columns]) / width)

    def draw_felt(self, n: int, rng: np.random.Generator) -> FloatArray:
        """The same with springs as stiff as the bar, within a few times."""
        return np.hstack([self._inner.draw_felt(n, rng), self._deviates(n, rng)])

    def smooth(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Shares of the box's ranges (n, b), in which the prior is flat, and deviates (n, s)."""
        inner, deviates = self._split(z)
        return (inner - self.box.lower) / (self.box.upper - self.box.lower), deviates

    def of_smooth(self, shares: FloatArray, deviates: FloatArray) -> FloatArray:
        """Parameters (n, parameters) of these, what is not seen at its middle."""
        inner = self.box.lower + (self.box.upper - self.box.lower) * shares
        return self._assembled(inner, deviates @ self._seen.T, None)

    def _deviates(self, n: int, rng: np.random.Generator) -> FloatArray:
        return rng.standard_normal((n, self.dimension - len(self.box.names)))

    def _split(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        count = len(self.box.names)
        return self._inner.theta(z[:, :count]), z[:, count:]


def _basis(rows: FloatArray) -> FloatArray:
    """Orthonormal columns (k, r) that span rows (r, k), less those that vanish."""
    left, size, _ = np.linalg.svd(rows.T, full_matrices=False)
    return np.asarray(left[:, size > 1e-9 * max(size.max(initial=0.0), 1e-300)])


def _is_felt(model: AsMade, spring: str, planes: set[Plane]) -> bool:
    """Whether a spring moves a mode of a measured plane."""
    if not isinstance(model.model, Beam):
        return True
    plane = PLANES[0] if spring in ("log10_k1", "log10_k3") else PLANES[1]
    return plane in planes
