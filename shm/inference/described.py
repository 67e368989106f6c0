"""The sampler's space for the bar as made: what frequencies see, and what they never tell.

Of the parameters of `shm.models.as_made` frequencies see the apparent tension a = T/(mu l^2) and a
few combinations of the deviations: c = sqrt(e/mu)/l^2 always, the area where the class shears, the
mass per length where a known mass was clamped on. Only these are sampled. What is left of the
deviations, and springs of planes that were not measured, is drawn from the prior afterwards, given
what a measured tension says of it: exactly, at no cost. That draw is what makes the tension's
interval absolute.

Priors: the tension's logarithm is uniform, as are log10 k L/EI; deviations are normal with the
standard deviations of the description, or as an earlier measured tension has calibrated them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


from shm.inference.coordinates import Coordinates, log_normal
from shm.models.as_made import BENDING, DENSITY, LENGTH, MODULUS, SECTION, TENSION, AsMade
from shm.models.beam import Beam, Beam3
from shm.values import PLANES, FloatArray, Hanger, IntArray, ModalTest, Plane, Prior

_DEVIATIONS = (SECTION, DENSITY, MODULUS)
_SENSOR_KG, _SENSOR_SD_KG = 0.05, 0.02


@dataclass(frozen=True, eq=False)
class Calibration:
    """What measured tensions have taught of the deviations of a bar as made.

    `names` are among `section`, `density`, `modulus`, `theta_L` and `bending_factor` (as logarithms
    of true over described); `mean` (k,) and `covariance` (k, k).
    """

    names: tuple[str, ...]
    mean: FloatArray
    covariance: FloatArray


@dataclass(frozen=True)
class TensionReading:
    """The tension that load cells, lift-offs or weights showed, all tests together."""

    tension_n: float
    sd: float
    """As a fraction of it."""


UNKNOWN_READING_SD = 0.03
"""Of a reading whose standard deviation is not stated: lift-offs repeat within 2 to 5 % (fib
Bulletin 30, Acceptance of stay cable systems)."""


def reading_of(tests: Sequence[ModalTest]) -> TensionReading | None:
    """The readings of all tests as one, weighted by their precision; None where there is none."""
    values = [
        (test.tension_read_n, _sd_of(test)) for test in tests if math.isfinite(test.tension_read_n)
    ]
    if not values:
        return None
    read, sd = np.array(values).T
    weight = sd**-2
    mean = float((weight * read).sum() / weight.sum())
    return TensionReading(mean, float(weight.sum() ** -0.5) / mean)


def _sd_of(test: ModalTest) -> float:
    known = math.isfinite(test.tension_read_sd_n) and test.tension_read_sd_n > 0
    return test.tension_read_sd_n if known else UNKNOWN_READING_SD * test.tension_read_n


class Deviations:
    """Normal prior of the deviations d = mean + factor n, n standard normal: `names` (k,).

    The length is one where it is taped, a strand's bending factor where it is stated or calibrated
    (its logarithm, to the stated one).
    """

    def __init__(self, model: AsMade, calibration: Calibration | None):
        hanger, scatter = model.hanger, model.hanger.scatter
        sensor_sd = _SENSOR_SD_KG / (hanger.mass_per_length_kg_m * hanger.length_m)
        sds = {
            SECTION: scatter.section,
            DENSITY: math.hypot(scatter.density, sensor_sd),
            MODULUS: scatter.modulus,
        }
        means = {DENSITY: _SENSOR_KG / (hanger.mass_per_length_kg_m * hanger.length_m)}
        if not model.length_is_open:
            sds[LENGTH] = scatter.length
        stated = model.is_strand and math.isfinite(scatter.bending_factor)
        taught = calibration is not None and BENDING in calibration.names
        if stated or (model.is_strand and taught):
            sds[BENDING] = scatter.bending_factor if stated else 0.3
        self.names = tuple(sds)
        self.mean: FloatArray = np.array([means.get(name, 0.0) for name in self.names])
        covariance = np.diag(np.array(list(sds.values())) ** 2)
        if calibration is not None:
            rows = [self.names.index(n) for n in calibration.names if n in self.names]
            kept = [k for k, n in enumerate(calibration.names) if n in self.names]
            self.mean[rows] = calibration.mean[kept]
            covariance[np.ix_(rows, rows)] = calibration.covariance[np.ix_(kept, kept)]
        self.factor: FloatArray = _root(covariance)

    def row(self, **shares: float) -> FloatArray:
        """How a combination of the deviations goes with n (k,)."""
        return np.asarray(np.array([shares.get(name, 0.0) for name in self.names]) @ self.factor)

    def column(self, deviations: FloatArray, name: str) -> FloatArray:
        """One of them (n,) of (n, k); 0 where it is none."""
        if name not in self.names:
            return np.zeros(len(deviations))
        return np.asarray(deviations[:, self.names.index(name)])


def _root(covariance: FloatArray) -> FloatArray:
    """A square root, also of a covariance in which some deviation is known."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(values.clip(0)))


class DescribedCoordinates:
    """Places z (n, d) of parameters theta (n, parameters) of a bar as made.

    First those of a box (`shm.inference.coordinates`): log tension, a length that is open, springs
    of the planes measured, a strand's bending factor; then the deviations as far as they are seen.
    `wave_stiffness_n_m_rad` is EI p of a mode in the middle of those measured.
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
        self.deviations = Deviations(model, calibration)
        self._slips = model.is_strand and BENDING not in self.deviations.names
        planes = {mode.plane for test in tests for mode in test.regular_modes}
        self._felt = tuple(n for n in model.springs if _is_felt(model, n, planes))
        self.box = self._box()
        swaps = [pair for pair in model.swaps if set(pair) <= set(self._felt)]
        self._inner = Coordinates(self.box, swaps, wave_stiffness_n_m_rad)
        # A factor that may be anything from 0.3 to 1 takes the part of c that frequencies see.
        seen = [] if self._slips else [self._row_c()]
        if isinstance(model.model, Beam3):
            seen.append(self.deviations.row(section=1.0))
        if any(test.added_mass is not None for test in tests):
            seen.append(self.deviations.row(section=1.0, density=1.0))
        self._seen = _basis(np.array(seen).reshape(len(seen), len(self.deviations.names)))
        self._reading = reading_of(tests)
        self.dimension = len(self.box.names) + self._seen.shape[1]

    def _box(self) -> Prior:
        bounds = {TENSION: tuple(np.log(self.model.bounds[TENSION]))}
        if self.model.length_is_open:
            bounds[LENGTH] = self.model.bounds[LENGTH]
        bounds |= {name: self.model.bounds[name] for name in self._felt}
        if self._slips:
            bounds[BENDING] = self.model.bounds[BENDING]
        lower, upper = np.array(list(bounds.values()), dtype=float).T
        return Prior(tuple(bounds), lower, upper)

    def _row_c(self) -> FloatArray:
        return self.deviations.row(
            section=0.5, density=-0.5, modulus=0.5, theta_L=-2.0, bending_factor=0.5
        )

    def _log_c(self, deviations: FloatArray) -> FloatArray:
        """ln c (n,) of deviations (n, k), but for the bending factor's part."""
        section, density, modulus, length = (
            self.deviations.column(deviations, name) for name in (*_DEVIATIONS, LENGTH)
        )
        return np.asarray((section - density + modulus) / 2 - 2 * length)

    @property
    def _row_mass(self) -> FloatArray:
        """ln(mu l^2): what stands between the tension and the apparent one."""
        return self.deviations.row(section=1.0, density=1.0, theta_L=2.0)

    @property
    def reading_sd(self) -> float:
        """Of a measured tension about one predicted without what frequencies do not see."""
        reading, unseen = self._reading, self._unseen_mass
        return math.hypot(reading.sd, float(np.linalg.norm(unseen))) if reading else math.nan

    @property
    def reading(self) -> TensionReading | None:
        return self._reading

    @property
    def _unseen_mass(self) -> FloatArray:
        row = self._row_mass
        return np.asarray(row - self._seen @ (self._seen.T @ row))

    def theta(self, z: FloatArray) -> FloatArray:
        """Parameters (n, parameters), what is not seen at its middle."""
        inner, seen = self._split(z)
        return self._assembled(inner, seen @ self._seen.T, None)

    def finished(self, z: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Draws of all parameters (n, parameters): what is not seen is drawn."""
        inner, seen = self._split(z)
        inner = self._inner.unfold(inner, rng)
        n = seen @ self._seen.T
        rest = rng.standard_normal(n.shape)
        n = n + self._given_reading(inner, n, rest - rest @ self._seen @ self._seen.T, rng)
        return self._assembled(inner, n, rng)

    def _given_reading(
        self, inner: FloatArray, n: FloatArray, rest: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """Unseen deviates (n, k) with their part along the mass as a measured tension has it."""
        reading, along = self._reading, self._unseen_mass
        size = float(np.linalg.norm(along))
        if reading is None or size == 0:
            return rest
        along = along / size
        predicted = self._log_tension(inner, n)
        off = math.log(reading.tension_n) - predicted
        variance = size**2 + reading.sd**2
        mean, sd = size * off / variance, reading.sd / math.sqrt(variance)
        drawn = mean + sd * rng.standard_normal(len(rest))
        return np.asarray(rest + (drawn - rest @ along)[:, None] * along)

    def _log_tension(self, inner: FloatArray, n: FloatArray) -> FloatArray:
        mass = self._row_mass
        mean = self.deviations.mean
        fixed = sum(
            share * mean[self.deviations.names.index(name)]
            for name, share in ((SECTION, 1.0), (DENSITY, 1.0), (LENGTH, 2.0))
            if name in self.deviations.names
        )
        nominal = math.log(self._hanger.nominal_tension_n)
        return np.asarray(nominal + inner[:, 0] + fixed + n @ mass)

    def tension_n(self, z: FloatArray) -> FloatArray:
        """The tension (n,) with what is not seen at its middle."""
        inner, seen = self._split(z)
        return np.asarray(np.exp(self._log_tension(inner, seen @ self._seen.T)))

    def _assembled(
        self, inner: FloatArray, n: FloatArray, rng: np.random.Generator | None
    ) -> FloatArray:
        """Parameters (n, parameters) of the box's and of deviates n (n, k)."""
        own = self.deviations
        deviations = own.mean + n @ own.factor.T
        section, density, modulus = (own.column(deviations, name) for name in _DEVIATIONS)
        box = dict(zip(self.box.names, inner.T, strict=True))
        length = box.get(LENGTH, np.exp(own.column(deviations, LENGTH)))
        stated = self._hanger.bending_stiffness_factor
        if self._slips:
            slip = box[BENDING] * np.exp(-2 * self._log_c(deviations))
        else:
            slip = stated * np.exp(own.column(deviations, BENDING))
        stiffness = np.exp(2 * section + modulus) * slip / stated
        taped = np.ones(len(n)) if self.model.length_is_open else length
        columns = {
            TENSION: np.exp(self._log_tension(inner, n)) / self._hanger.nominal_tension_n,
            LENGTH: length,
            SECTION: section,
            DENSITY: density,
            MODULUS: modulus,
            BENDING: slip,
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
        length, slip = values[LENGTH], values.get(BENDING, np.full(len(theta), stated))
        logs = {
            SECTION: values[SECTION],
            DENSITY: values[DENSITY],
            MODULUS: values[MODULUS],
            LENGTH: np.log(length),
            BENDING: np.log(slip / stated),
        }
        deviations = np.column_stack([logs[name] for name in own.names])
        n = (deviations - own.mean) @ np.linalg.pinv(own.factor).T
        taped = np.ones(len(theta)) if self.model.length_is_open else length
        stiffness = np.exp(2 * values[SECTION] + values[MODULUS]) * slip / stated
        mass = np.exp(values[SECTION] + values[DENSITY])
        box = {TENSION: np.log(values[TENSION] / (mass * taped**2)), LENGTH: length}
        box[BENDING] = slip * np.exp(2 * self._log_c(deviations))
        box |= {name: values[name] - np.log10(stiffness / taped) for name in self._felt}
        inner = np.column_stack([box[name] for name in self.box.names])
        inner = inner.clip(self.box.lower, self.box.upper)
        return np.hstack([self._inner.places(inner), n @ self._seen])

    def shared(self, names: Sequence[str], samples: FloatArray) -> tuple[IntArray, FloatArray]:
        """The columns of z that draws (n, parameters) of any class know, and their places there:
        the apparent tension's, and those of the deviations.
        """
        known = dict(zip(names, samples.T, strict=True))
        middle = [sum(self.model.bounds[name]) / 2 for name in self.names]
        theta = np.column_stack(
            [
                known[name] if name in known and name not in self.model.springs else
                np.full(len(samples), usual)
                for name, usual in zip(self.names, middle, strict=True)
            ]
        )
        z = self.places(theta)
        columns = np.append(0, np.arange(len(self.box.names), self.dimension))
        return columns, z[:, columns]

    def fold(self, z: FloatArray) -> FloatArray:
        """`z` (n, d) with each point replaced by its copy inside the fold."""
        count = len(self.box.names)
        return np.hstack([self._inner.fold(z[:, :count]), z[:, count:]])

    def log_prior(self, z: FloatArray) -> FloatArray:
        """Log density (n,) of the folded prior at `z` (n, d); -inf outside of it."""
        count = len(self.box.names)
        return np.asarray(self._inner.log_prior(z[:, :count]) + log_normal(z[:, count:]))

    def draw_prior(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Places (n, d) from the folded prior."""
        return np.hstack([self._inner.draw_prior(n, rng), self._draw_seen(n, rng)])

    def draw_felt(self, n: int, rng: np.random.Generator) -> FloatArray:
        """The same with springs as stiff as the bar, within a few times."""
        return np.hstack([self._inner.draw_felt(n, rng), self._draw_seen(n, rng)])

    def smooth(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Shares of the box's ranges (n, b), in which the prior is flat, and deviates (n, s)."""
        inner, seen = self._split(z)
        return (inner - self.box.lower) / (self.box.upper - self.box.lower), seen

    def of_smooth(self, shares: FloatArray, seen: FloatArray) -> FloatArray:
        """Parameters (n, parameters) of these, what is not seen at its middle."""
        inner = self.box.lower + (self.box.upper - self.box.lower) * shares
        return self._assembled(inner, seen @ self._seen.T, None)

    def _draw_seen(self, n: int, rng: np.random.Generator) -> FloatArray:
        return rng.standard_normal((n, self._seen.shape[1]))

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


def calibration_of(
    names: Sequence[str], samples: FloatArray, hanger: Hanger
) -> Calibration:
    """What draws (n, parameters) of a posterior say of the bar's deviations."""
    values = dict(zip(names, samples.T, strict=True))
    kept = [n for n in (*_DEVIATIONS, LENGTH, BENDING) if n in values]
    stated = hanger.bending_stiffness_factor
    logs = {LENGTH: lambda v: np.log(v), BENDING: lambda v: np.log(v / stated)}
    table = np.column_stack([logs.get(n, np.asarray)(values[n]) for n in kept])
    return Calibration(tuple(kept), table.mean(axis=0), np.atleast_2d(np.cov(table.T)))
