"""The sampler's space for the bar as made: what frequencies see, and what they never tell.

Of the parameters of a hanger's model frequencies see the apparent tension a = T/(mu l^2) and a
few combinations of the deviations: c = sqrt(e/mu)/l^2 always, the area where the class shears, the
mass per length where a known mass was clamped on. Only these are sampled. What is left of the
deviations, and ends and terms of planes that were not measured, is drawn from the prior afterwards,
given what a measured tension says of it: exactly, at no cost. That draw is what makes the tension's
interval absolute.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy

from shm.inference.options import Calibration
from shm.inference.problem.priors import (
    DEVIATIONS,
    Deviations,
    Ends,
    TensionPrior,
    errors_of_reading,
    reading_of,
)
from shm.inference.problem.shapes import swaps_of
from shm.inference.sampler.coordinates import Coordinates, log_normal
from shm.models import AsMade
from shm.models.classes.beam import Beam, Beam3
from shm.models.one_hanger.hanger_model import (
    BENDING,
    DENSITY,
    LENGTH,
    MODULUS,
    SECTION,
    SHEAR,
    TENSION,
)
from shm.values import PLANES, FloatArray, IntArray, ModalTest, Plane, Prior

# c = sqrt(e/mu)/l^2 with e ~ modulus section^2 and mu ~ density section.
_C = {SECTION: 0.5, DENSITY: -0.5, MODULUS: 0.5, LENGTH: -2.0, BENDING: 0.5}
_MASS = {SECTION: 1.0, DENSITY: 1.0, LENGTH: 2.0}
"""ln c and ln(mu l^2) by the deviations."""

_WIDER = (0.9, 1.15)
"""Numerical: the range of a strand's factor, widened by what tolerances and length do to c."""

_MOST_REDRAWN = 20  # a factor that is inside in half of its draws is left outside by 1e-6 of them


class DescribedCoordinates:
    """Coordinates z (n, d) of parameters theta (n, parameters) of a bar as made.

    The columns are those of `names` (tension, a length that plates leave open, springs of a solid,
    a strand's bending factor and shear, effects), the scores of the ends that are felt, those of
    the terms that are felt, and the deviations as far as they are seen, the last of them ln c.
    `wave_stiffness_n_m_rad` is EI p of a mode in the middle of those measured. Of a strand whose
    factor is open, the factor takes all of c. The nominal tension is the true one to within
    `known_tension_sd`, a fraction, where that is finite.
    """

    def __init__(
        self,
        model: AsMade,
        tests: Sequence[ModalTest],
        wave_stiffness_n_m_rad: float,
        calibration: Calibration | None = None,
        known_tension_sd: float = math.nan,
    ):
        self.model, self._hanger = model, model.hanger
        self.parameters = model.parameter_names
        self.deviations = prior = Deviations(model, calibration)
        self._slips = model.is_strand and BENDING not in prior.names
        self._open = model.length_is_open
        planes = {mode.plane for test in tests for mode in test.regular_modes}
        beam = isinstance(model.model, Beam)
        felt = tuple(n for n in model.springs if not beam or _plane_of(n) in planes)
        exchangeable = swaps_of(model, tests)
        self.ends = Ends(self._hanger, felt if beam else (), exchangeable)
        self.terms = [t for t in model.terms.values() if not t.plane or t.plane in planes]
        box = self._box(() if beam else felt)
        self.names = (TENSION, *box)
        bounds, assumed = model.bounds[TENSION], self._hanger.assumptions
        self._tension = TensionPrior(bounds, assumed, known_tension_sd)
        lower, upper = np.array(list(box.values()), dtype=float).reshape(-1, 2).T
        swaps = [pair for pair in exchangeable if set(pair) <= set(box)]
        self._box_coordinates = Coordinates(
            Prior(tuple(box), lower, upper), swaps, wave_stiffness_n_m_rad
        )
        self._reading = reading_of(tests, self._hanger.assumptions)
        others = []
        if isinstance(model.model, Beam3) and not model.is_strand:
            others.append(prior.row(section=1.0))
        if model.effect_names:  # they are of other sizes on another bar
            others += [prior.row(section=1.0), prior.row(density=1.0), prior.row(theta_L=1.0)]
        if any(test.added_mass is not None for test in tests):
            others.append(prior.row(section=1.0, density=1.0, theta_L=1.0))
        seen = [] if self._slips else [prior.row(**_C)]
        self._seen = _basis(np.array([*others, *seen]).reshape(-1, len(prior.names)))
        sizes = [len(self.names), len(felt) if beam else 0, len(self.terms), self._seen.shape[1]]
        self._cuts = np.cumsum(sizes)[:-1]
        self.dimension = sum(sizes)

    def _box(self, springs: tuple[str, ...]) -> dict[str, tuple[float, float]]:
        """Return the ranges of the parameters with uniform priors, but for the tension."""
        bounds = {}
        if self._open:
            bounds[LENGTH] = self.model.bounds[LENGTH]
        bounds |= {name: self.model.bounds[name] for name in springs}
        if self._slips:
            low, high = self.model.bounds[BENDING]
            bounds[BENDING] = (_WIDER[0] * low, _WIDER[1] * high)
        if SHEAR in self.parameters:
            bounds[SHEAR] = self.model.bounds[SHEAR]
        return bounds | {name: self.model.bounds[name] for name in self.model.effect_names}

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
        self, log_tension: FloatArray, deviates: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """Draw n (n, k) given what is seen of it (n, r), and the reading along the mass."""
        rest = rng.standard_normal((len(deviates), len(self._row_mass)))
        n = (deviates - rest @ self._seen) @ self._seen.T + rest
        along = self._unseen_mass
        size = float(np.linalg.norm(along))
        if self._reading is None or size == 0:
            return np.asarray(n)
        along = along / size
        nominal = math.log(self._hanger.nominal_tension_n) + self._mean_mass
        off = math.log(self._reading.tension_n) - nominal - log_tension - n @ self._row_mass
        usual, gross = (
            log_share + scipy.stats.norm.logpdf(off + size * (n @ along), scale=sd)
            for sd, log_share in errors_of_reading(self.reading_sd, self._hanger.assumptions)
        )
        is_usual = rng.random(len(n)) < scipy.special.expit(usual - gross)
        off = off - self._reading.sd * rng.standard_normal(len(n))
        # Matheron's rule: the prior draw moved by what the noisy reading misses it by.
        gain = is_usual * size / (size**2 + self._reading.sd**2)
        return np.asarray(n + (gain * off)[:, None] * along)

    @property
    def _mean_mass(self) -> float:
        return float(sum(self.deviations.mean_of(name) * share for name, share in _MASS.items()))

    # ------------------------------------------------ coordinates and parameters

    def theta(self, z: FloatArray) -> FloatArray:
        """Return parameters (n, parameters), what is not seen at its middle."""
        box, ends, terms, deviates = np.split(z, self._cuts, axis=1)
        return self._assembled(self._values(box), ends, terms, deviates @ self._seen.T, None)

    def finished(self, z: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return draws of all parameters (n, parameters): what is not seen is drawn."""
        box, ends, terms, deviates = np.split(z, self._cuts, axis=1)
        values, ends = self._values(box, rng), self.ends.exchanged(ends, rng)
        log_tension = values[TENSION]
        n = self._drawn(log_tension, deviates, rng)
        theta = self._assembled(values, ends, terms, n, rng)
        if self._slips:
            column, (low, high) = self.parameters.index(BENDING), self.model.bounds[BENDING]
            for _ in range(_MOST_REDRAWN):
                out = np.flatnonzero((theta[:, column] < low) | (theta[:, column] > high))
                if not len(out):
                    break
                again = self._drawn(log_tension[out], deviates[out], rng)
                part = {name: value[out] for name, value in values.items()}
                theta[out] = self._assembled(part, ends[out], terms[out], again, rng)
        return theta

    def tension_n(self, z: FloatArray) -> FloatArray:
        """Return the tension (n,) with what is not seen at its middle."""
        return self.theta(z)[:, 0] * self._hanger.nominal_tension_n

    def _values(
        self, box: FloatArray, rng: np.random.Generator | None = None
    ) -> dict[str, FloatArray]:
        """Return ln of the apparent tension's ratio, and the box's parameters, each (n,).

        With `rng`, springs that can be exchanged are, by chance.
        """
        of = self._box_coordinates
        others = of.theta(box[:, 1:]) if rng is None else of.finished(box[:, 1:], rng)
        columns = dict(zip(of.prior.names, others.T, strict=True))
        return {TENSION: self._tension.value(box[:, 0]), **columns}

    def _assembled(
        self,
        box: dict[str, FloatArray],
        ends: FloatArray,
        terms: FloatArray,
        n: FloatArray,
        rng: np.random.Generator | None,
    ) -> FloatArray:
        """Return parameters (n, parameters) of these and of deviates n (n, k)."""
        prior, stated = self.deviations, self._hanger.bending_stiffness_factor
        deviations = prior.mean + n @ prior.factor.T
        section, density, modulus = (prior.column(deviations, name) for name in DEVIATIONS)
        taped = np.exp(prior.column(deviations, LENGTH))
        if self._slips:
            log_c = (section - density + modulus) / 2 - 2 * np.log(taped)
            slip = box[BENDING] * np.exp(-2 * log_c)
        else:
            slip = stated * np.exp(prior.column(deviations, BENDING))
        stiffness = np.exp(2 * section + modulus) * slip / stated
        columns = {
            TENSION: np.exp(box[TENSION] + section + density) * taped**2,
            LENGTH: box.get(LENGTH, taped),
            SECTION: section,
            DENSITY: density,
            MODULUS: modulus,
            BENDING: slip,
            SHEAR: box.get(SHEAR, slip),
        }
        springs = {name: box[name] for name in self.model.springs if name in box}
        if isinstance(self.model.model, Beam) and self.model.springs:
            springs = self.ends.log10_springs(ends, self._slenderness(box), rng)
        columns |= {name: box[name] for name in self.model.effect_names}
        columns |= {name: log + np.log10(stiffness / taped) for name, log in springs.items()}
        of_term = dict(zip((t.name for t in self.terms), terms.T, strict=True))
        for name, term in self.model.terms.items():
            unfelt = np.zeros(len(n)) if rng is None else rng.standard_normal(len(n))
            columns[name] = term.value(of_term.get(name, unfelt))
        return np.column_stack([columns[name] for name in self.parameters])

    def _slenderness(self, box: dict[str, FloatArray]) -> FloatArray:
        """Return L sqrt(T/EI) (n,)."""
        hanger = self._hanger
        nominal = hanger.nominal_tension_n * hanger.length_m**2 / hanger.bending_stiffness_n_m2
        square = nominal * np.exp(box[TENSION])
        if self._slips:
            square = square * hanger.bending_stiffness_factor / box[BENDING]
        return np.asarray(np.sqrt(square))

    def places(self, theta: FloatArray) -> FloatArray:
        """Return coordinates (n, d) of parameters (n, parameters)."""
        values = dict(zip(self.parameters, theta.T, strict=True))
        prior, stated = self.deviations, self._hanger.bending_stiffness_factor
        taped = np.ones(len(theta)) if self._open else values[LENGTH]
        slip = values.get(BENDING, np.full(len(theta), stated))
        logs = {name: values[name] for name in DEVIATIONS}
        logs |= {BENDING: np.log(slip / stated), LENGTH: np.log(taped)}
        deviations = np.column_stack(
            [logs.get(name, np.full(len(theta), prior.mean_of(name))) for name in prior.names]
        )
        stiffness = np.exp(2 * values[SECTION] + values[MODULUS]) * slip / stated
        mass = np.exp(values[SECTION] + values[DENSITY])
        log_c = np.log(stiffness / mass) / 2 - 2 * np.log(taped)
        box = {TENSION: np.log(values[TENSION] / (mass * taped**2)), LENGTH: values[LENGTH]}
        box |= {BENDING: stated * np.exp(2 * log_c), SHEAR: values.get(SHEAR, slip)}
        box |= {name: values[name] for name in self.model.effect_names}
        springs = {n: values[n] - np.log10(stiffness / taped) for n in self.model.springs}
        of = self._box_coordinates
        inner = np.array([{**box, **springs}[name] for name in of.prior.names])
        inner = inner.reshape(len(of.prior.names), len(theta)).T.clip(
            of.prior.lower, of.prior.upper
        )
        ends = self.ends.scores(springs, self._slenderness(box), len(theta))
        terms = [term.score(values[term.name]).clip(-_SCORES, _SCORES) for term in self.terms]
        deviates = (deviations - prior.mean) @ np.linalg.pinv(prior.factor).T @ self._seen
        return np.column_stack(
            [self._tension.score(box[TENSION]), of.places(inner), ends, *terms, deviates]
        )

    def fold(self, z: FloatArray) -> FloatArray:
        """Return `z` (n, d) with the stiffer spring of each exchangeable pair first."""
        box, ends, terms, deviates = np.split(z, self._cuts, axis=1)
        box = np.column_stack([box[:, :1], self._box_coordinates.fold(box[:, 1:])])
        return np.hstack([box, self.ends.fold(ends), terms, deviates])

    def connect(self, z: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Fold no pair whose posterior, that of points `z` (n, d), goes on beyond the fold.

        Returns the points with these pairs exchanged or not by chance.
        """
        box, ends, terms, deviates = np.split(z, self._cuts, axis=1)
        box = np.column_stack([box[:, :1], self._box_coordinates.connect(box[:, 1:], rng)])
        return np.hstack([box, self.ends.connect(ends, rng), terms, deviates])

    def log_prior(self, z: FloatArray) -> FloatArray:
        """Return the log density (n,) of the folded prior at `z` (n, d); -inf outside of it."""
        box, ends, _, _ = np.split(z, self._cuts, axis=1)
        once = self._box_coordinates.log_prior(box[:, 1:]) - log_normal(box[:, 1:])
        return np.asarray(log_normal(z) + once + self.ends.log_folded(ends))

    def draw_prior(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Draw coordinates (n, d) from the folded prior."""
        return self.fold(rng.standard_normal((n, self.dimension)))

    def draw_felt(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Draw the same with ends neither loose nor fast, where frequencies tell how stiff."""
        z = self.draw_prior(n, rng)
        box, ends, terms, deviates = np.split(z, self._cuts, axis=1)
        felt = self._box_coordinates.draw_felt(n, rng)
        box = np.column_stack([box[:, :1], felt])
        return self.fold(np.hstack([box, _FELT * ends, terms, deviates]))

    @property
    def ends_at(self) -> slice:
        """Return the columns of the ends' scores."""
        return slice(self._cuts[0], self._cuts[1])

    @property
    def always_linear(self) -> IntArray:
        """Return the columns in which logarithms of frequencies are nearly linear: the tension and
        what is seen of the deviations.
        """
        return np.append(0, np.arange(self._cuts[2], self.dimension))

    @property
    def nearly_linear(self) -> IntArray:
        """Return the columns of the terms, in which they may be."""
        return np.arange(self._cuts[1], self._cuts[2])

    def asked_of_description(self, z: FloatArray) -> FloatArray:
        """Return the scores (n, k) of terms and deviations: what the description is off by."""
        return np.asarray(z[:, self._cuts[1] :])

    def seen_deviates(self, z: FloatArray) -> FloatArray:
        """Return the deviations (n, r) as far as they are seen, in standard deviations."""
        return np.split(z, self._cuts, axis=1)[3]

    def fractions_of_ranges(self, z: FloatArray) -> FloatArray:
        """Return where in their ranges (0 to 1) the parameters of `names` are (n, names)."""
        box = np.split(z, self._cuts, axis=1)[0]
        low, high = np.log(self.model.bounds[TENSION])
        tension = (self._tension.value(box[:, 0]) - low) / (high - low)
        return np.column_stack([tension, scipy.special.ndtr(box[:, 1:])])


_SCORES = 6.0  # standard deviations: no draw lies beyond
_FELT = 0.5


def _basis(rows: FloatArray) -> FloatArray:
    """Return orthonormal columns (k, r) that span rows (r, k), less those that vanish."""
    left, size, _ = np.linalg.svd(rows.T, full_matrices=False)
    return np.asarray(left[:, size > 1e-9 * max(size.max(initial=0.0), 1e-300)])


def _plane_of(spring: str) -> Plane:
    """Return the plane of an end spring of a beam."""
    return PLANES[0] if spring in ("log10_k1", "log10_k3") else PLANES[1]
