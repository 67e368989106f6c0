"""Maximum-likelihood modes of a narrow band of the spectrum of ambient motion.

One mode or a few close ones, moved by noise, over a floor of noise, seen by several sensors whose
shapes are known: what Au fits to a fast Fourier transform (Mech. Syst. Signal Process. 26, 2012,
15, and 48, 2014). The lines are independent and complex Gaussian (Whittle 1953); their covariance
is that of a finite record, whose ends widen the peaks (Sykulski et al., Biometrika 106, 2019).

With the poles `c_k = a_k + i (w - w_k)` at the angular frequency w, of modes that decay by `a_k`,
and `P` the covariance of their complex amplitudes, the modes' covariance in a record of T seconds
is `Q = G P + P G*`, G diagonal with `1/c - (1 - exp(-c T)) / (c^2 T)`. Two directions see `E = B Q
B^T + n`, n diagonal. A Hermitian 2 x 2 matrix X has x0 + x3 and x0 - x3 on its diagonal, x1 - i x2
beside it. With `[X, Y] = 2 (x0 y0 - x1 y1 - x2 y2 - x3 y3)`, `tr X Y^-1 = [X, Y] / det Y` and `tr
E^-1 X E^-1 Y = tr(E^-1 X) tr(E^-1 Y) - [X, Y] / det E`: all that a likelihood needs, in reals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from shm.monitor.limits import LIMITS
from shm.monitor.spectrum import Stretch
from shm.values import ComplexArray, FloatArray

_SIGNS = np.array([1.0, -1.0, -1.0, -1.0])[:, np.newaxis]


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines of a band.

    `radians_s`, `seconds`, `count` (lines,): angular frequency, length of the stretch, how many
    lines are averaged; `power` (lines, channels, channels): their mean outer product.
    """

    radians_s: FloatArray
    seconds: FloatArray
    count: FloatArray
    power: ComplexArray


def lines_of(
    stretches: Sequence[Stretch],
    bands_hz: Sequence[tuple[float, float]],
    half_hz: float,
    unit: FloatArray,
) -> Lines:
    """Return the lines of bands, averaged where a peak of that half width is finely resolved.

    Channels are in units of `unit` (channels,).
    """
    parts = []
    for each, band_hz in product(stretches, bands_hz):
        inside = each.between(*band_hz)
        values = each.values[:, inside] / unit[:, np.newaxis]
        many = max(1, int(LIMITS.bin * half_hz * each.seconds))
        bins = values.shape[1] // many
        grouped = values[:, : bins * many].reshape(len(values), bins, many).transpose(1, 0, 2)
        at = inside.start + many * np.arange(bins) + (many - 1) / 2
        seconds, count = np.full(bins, each.seconds), np.full(bins, float(many))
        power = grouped @ grouped.conj().transpose(0, 2, 1) / many
        parts.append((2 * math.pi * at / each.seconds, seconds, count, power))
    return Lines(*(np.concatenate(rows) for rows in zip(*parts, strict=True)))


@dataclass(frozen=True, eq=False)
class CloseModes:
    """Parameters of the modes of a band; arrays (modes,).

    `radians_s`, `decay_1_s`: angular frequency, and damping times it. `power`: half the mean
    square acceleration where the mode moves most; `slope`: exponent of frequency by which its
    spectrum differs from that under white force; `tilt`: of its shape across the known one, in the
    two directions that are seen; `coherence` (modes, modes): correlation of the complex amplitudes,
    its diagonal 1. `floor` (2,): power density of the noise along a direction.
    """

    radians_s: FloatArray
    decay_1_s: FloatArray
    power: FloatArray
    slope: FloatArray
    tilt: FloatArray
    coherence: ComplexArray
    floor: FloatArray

    def only(self, indices: Sequence[int]) -> CloseModes:
        """Return some of them."""
        rows = list(indices)
        return CloseModes(
            self.radians_s[rows],
            self.decay_1_s[rows],
            self.power[rows],
            self.slope[rows],
            self.tilt[rows],
            self.coherence[np.ix_(rows, rows)],
            self.floor,
        )

    @property
    def covariance(self) -> ComplexArray:
        """P (modes, modes)."""
        root = np.sqrt(self.power)
        covariance: ComplexArray = self.coherence * np.outer(root, root)
        return covariance

    def moved(self, step: FloatArray) -> CloseModes:
        """After a step in frequencies (half bandwidths), log decay rates, log powers, slopes,
        tilts, correlations (real, imaginary) and log floors."""
        count = len(self.power)
        its = step[: 5 * count].reshape(5, count)
        decay = self.decay_1_s * np.exp(its[1])
        radians = self.radians_s + self.decay_1_s * its[0]
        coherence = self.coherence.copy()
        for place, (one, two) in enumerate(combinations(range(count), 2)):
            real, imaginary = step[5 * count + 2 * place : 5 * count + 2 * place + 2]
            value = coherence[one, two] + real + 1j * imaginary
            # What moves both is at most wholly coherent, and modes apart in frequency then less.
            poles = decay[one] + decay[two] + 1j * (radians[one] - radians[two])
            most = LIMITS.most_coherent * 2 * math.sqrt(decay[one] * decay[two]) / abs(poles)
            value *= min(1.0, most / max(abs(value), most))
            coherence[one, two], coherence[two, one] = value, np.conj(value)
        return CloseModes(
            radians,
            decay,
            self.power * np.exp(its[2]),
            self.slope + its[3],
            self.tilt + its[4],
            coherence,
            self.floor * np.exp(step[-2:]),
        )


@dataclass(frozen=True, eq=False)
class BandFit:
    """The most likely modes, the log likelihood (with what was known before), and the covariance of
    the parameters in the order and units of `CloseModes.moved`."""

    modes: CloseModes
    log_likelihood: float
    covariance: FloatArray


class Band:
    """Lines of a band seen along one or two orthonormal `directions` (channels, 1 or 2), in which
    modes have `shapes` (channels, modes); `known` centres the weak knowledge from before.
    """

    def __init__(
        self, lines: Lines, directions: FloatArray, shapes: FloatArray, known: CloseModes
    ) -> None:
        self.lines, self.directions, self.shapes, self.known = lines, directions, shapes, known
        self.alone = directions.shape[1] == 1
        if self.alone:  # a second direction that sees nothing and of which all is known
            directions = np.hstack((directions, np.zeros_like(directions)))
        seen = directions.T @ lines.power @ directions
        self.seen = _components(seen[:, 0, 0].real, seen[:, 1, 1].real + self.alone, seen[:, 0, 1])
        natural = known.radians_s[:, np.newaxis]
        self.off = lines.radians_s / natural - 1
        # The slope that an acceleration under white force has beside its peak.
        sloped = (1 + self.off) ** 2 / (1 + self.off / 2)
        self.along = (directions.T @ shapes).T[:, :, np.newaxis] * sloped[:, np.newaxis, :]
        self.across = np.zeros_like(self.along)
        if not self.alone:
            self.across = self.along[:, ::-1] * np.array([-1.0, 1.0])[:, np.newaxis]

    def only(self, indices: Sequence[int]) -> Band:
        """Of some of the modes, along the same directions."""
        return Band(self.lines, self.directions, self.shapes[:, indices], self.known.only(indices))

    def fitted(self, start: CloseModes, most: int = 25) -> BandFit:
        """Return the most likely modes from a start, by Fisher scoring in at most so many steps."""
        modes, damped = start, 1e-3
        value, gradient, information = self.evaluated(modes)
        for _ in range(most):
            curved = information + damped * np.diag(np.diag(information))
            step = np.clip(np.linalg.solve(curved, gradient), -LIMITS.most_step, LIMITS.most_step)
            trial = modes.moved(step)
            better, *others = self.evaluated(trial)
            if better > value:
                gain, value, modes, (gradient, information) = better - value, better, trial, others
                damped /= 10
                # Technical: of log likelihood in a step; the next one gains its square
                if gain < 0.02:
                    break
            elif damped > 1e2:
                break
            else:
                damped *= 10
        return BandFit(modes, value, np.asarray(np.linalg.inv(information), dtype=np.float64))

    def evaluated(self, modes: CloseModes) -> tuple[float, FloatArray, FloatArray]:
        """Log likelihood, its gradient and the information of Fisher, known things included."""
        expected, changes = self._covariances(modes)
        count = self.lines.count
        determinant = np.sum(_SIGNS * expected**2, axis=0)
        reversed_ = 2 * _SIGNS / determinant
        ratio = np.sum(reversed_ * expected * self.seen, axis=0)
        value = -float(count @ (np.log(determinant) + ratio))
        trace = np.sum(changes * (reversed_ * expected), axis=1)
        crossed = (changes * (reversed_ * count)).reshape(len(changes), -1)
        gradient = (trace * (ratio - 1)) @ count - crossed @ self.seen.ravel()
        information = (trace * count) @ trace.T - crossed @ changes.reshape(len(changes), -1).T
        offset, precision = self._from_before(modes)
        value -= float(precision @ offset**2) / 2
        # Technical: what nothing is known of, a mode without power, still has an inverse
        return value, gradient - precision * offset, information + np.diag(precision + 1e-9)

    def _covariances(self, modes: CloseModes) -> tuple[FloatArray, FloatArray]:
        """E (4, lines), and its change by each parameter (parameters, 4, lines)."""
        covariance = modes.covariance
        sloped = np.exp(modes.slope[:, np.newaxis] * self.off)
        seen = sloped[:, np.newaxis] * (
            self.along + modes.tilt[:, np.newaxis, np.newaxis] * self.across
        )
        response, by_pole = self._responses(modes)
        held = np.tensordot(covariance, seen, axes=1)  # P B^T (modes, 2, lines)
        together = response[:, np.newaxis] * held
        together += np.tensordot(covariance, seen * response.conj()[:, np.newaxis], axes=1)
        by_decay = (by_pole * modes.decay_1_s[:, np.newaxis])[:, np.newaxis] * held
        across = sloped[:, np.newaxis] * self.across
        left, right = [*[seen] * 4, across], [-1j * by_decay, by_decay, together / 2]
        right += [together * self.off[:, np.newaxis], together]
        for one, two in combinations(range(len(seen)), 2):
            size = math.sqrt(modes.power[one] * modes.power[two])
            both = (size * (response[one] + response[two].conj())) * seen[two]
            left.append(np.array([seen[one], seen[one]]))
            right.append(np.array([both, 1j * both]))
        u, v = np.concatenate(left), np.concatenate(right)
        changes = np.zeros((len(u) + 2, 4, seen.shape[2]))
        changes[:-2] = _components(
            2 * u[:, 0] * v[:, 0].real,
            2 * u[:, 1] * v[:, 1].real,
            u[:, 0] * v[:, 1] + u[:, 1] * v[:, 0].conj(),
        ).transpose(1, 0, 2)
        noise = modes.floor / 2 * ([1.0, 0.0] if self.alone else [1.0, 1.0])
        changes[-2:, 0] = noise[:, np.newaxis]
        changes[-2:, 3] = (noise * [1.0, -1.0])[:, np.newaxis]
        number = len(seen)
        expected: FloatArray = changes[2 * number : 3 * number].sum(axis=0)
        expected += changes[-2:].sum(axis=0)
        if self.alone:
            expected[0] += 0.5
            expected[3] -= 0.5
        return expected, changes

    def _responses(self, modes: CloseModes) -> tuple[ComplexArray, ComplexArray]:
        """G and its derivative by the pole (modes, lines)."""
        seconds = self.lines.seconds
        pole = modes.decay_1_s[:, np.newaxis] + 1j * (
            self.lines.radians_s - modes.radians_s[:, np.newaxis]
        )
        inverse, end = 1 / pole, np.exp(-pole * seconds)
        short = (1 - end) * inverse / seconds
        response = np.asarray(inverse * (1 - short), dtype=np.complex128)
        by_pole = np.asarray(inverse**2 * (2 * short - 1 - end), dtype=np.complex128)
        return response, by_pole

    def _from_before(self, modes: CloseModes) -> tuple[FloatArray, FloatArray]:
        """Return how far the parameters are off what was known, and its precision."""
        number, zero = len(modes.power), np.zeros(len(modes.power))
        pairs = [modes.coherence[pair] for pair in combinations(range(number), 2)]
        offset = [
            zero,
            np.log(modes.decay_1_s / self.known.decay_1_s),
            zero,
            modes.slope,
            modes.tilt,
        ]
        offset += [np.array([[p.real, p.imag] for p in pairs]).ravel()]
        offset += [np.log(modes.floor / self.known.floor)]
        sds = (
            math.inf,
            LIMITS.damping_sd,
            math.inf,
            LIMITS.slope_sd,
            LIMITS.tilt_sd,
            LIMITS.coherence_sd,
            LIMITS.floor_sd,
        )
        precision = [np.full(len(each), sd**-2) for each, sd in zip(offset, sds, strict=True)]
        return np.concatenate(offset), np.concatenate(precision)


def directions(shapes: FloatArray) -> FloatArray:
    """One or two orthonormal columns (channels, 1 or 2) in which the modes of `shapes` move most.

    The first is that of the first mode: with sensors in two planes they are nearly the planes.
    """
    unit = shapes / np.linalg.norm(shapes, axis=0)
    first = unit[:, :1]
    rest = unit - first @ (first.T @ unit)
    size = np.linalg.norm(rest, axis=0)
    most = int(np.argmax(size))
    if size[most] < LIMITS.same_direction:
        return np.asarray(first)
    return np.hstack((first, rest[:, [most]] / size[most]))


def _components(first: FloatArray, second: FloatArray, off_diagonal: ComplexArray) -> FloatArray:
    """x0 to x3 of Hermitian matrices with these diagonals, and `off_diagonal` in the first row."""
    return np.array(
        [(first + second) / 2, off_diagonal.real, -off_diagonal.imag, (first - second) / 2]
    )
