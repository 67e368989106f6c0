"""Which modes of a recording of `tests/worlds/recordings.py` anybody could identify.

The Cramér-Rao bound of one who is told everything true as a start: all frequencies, dampings,
shapes and moments of the hits, and the density of the noise. He still has to estimate of every mode
at once its frequency and damping, its complex shape at the sensors, and how it rings after each
contact (or, in wind, how hard it is driven): so that a neighbour's skirt costs what it must cost.

The world's "20 dB above the rest" compares a mode with broadband noise over the whole record and
not with other modes. A mode counts as identifiable where the bound leaves its frequency sure to
0.1 % and its plane told. What is not in here only makes it harder: clipping, gaps, lines of
machines, delays and clocks, frequencies that move with the amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.worlds.recorded_structures import PLANES
from tests.worlds.recordings import ModeTruth, Recording

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
SURE = 0.001
"""Largest standard deviation of a frequency, relative: what `identify` asks of a hammer test."""
TOLD = 0.5
"""Largest standard deviation of a shape across its plane over its size in it: at a half, two
deviations keep its direction on the right side of 45 degrees."""
_REACH = 12.0  # technical: bandwidths at which a mode still counts as a neighbour; 0.2 % of a peak
_LINES = 160  # technical: of the integral over one mode's surroundings in ambient motion
_SINGULAR = 1e-11  # technical: of the information's own scale; above its rounding


@dataclass(frozen=True)
class Bound:
    """Least standard deviations: of the frequency, relative; of the shape across its plane."""

    frequency: float
    across: float

    @property
    def identifiable(self) -> bool:
        return self.frequency < SURE and self.across < TOLD


def bounds(case: Recording) -> tuple[Bound, ...]:
    """One for each of the case's true modes."""
    modes = case.truth.modes
    seconds = len(case.data) / case.rate_hz
    if not case.truth.hits:
        return tuple(_in_wind(k, modes, case, seconds) for k in range(len(modes)))
    ends = np.array([hit.time_s + hit.contact_s for hit in case.truth.hits])
    spans = np.diff(np.append(ends, seconds))
    spread = ring_down_covariance(modes, np.clip(spans, 0, None))
    return tuple(_bound(mode, own, case) for mode, own in zip(modes, spread, strict=True))


def _bound(mode: ModeTruth, covariance: Array, case: Recording) -> Bound:
    """`covariance` is that of frequency in rad/s, damping, and the weighted shape's values."""
    planes = [c.plane for c in case.channels if c.quantity == "acceleration"]
    noise = np.sqrt(np.where(np.isfinite(mode.noise), mode.noise, 0.0))
    shape = np.array(mode.shape)
    of_shape = np.diag(covariance)[2:].reshape(len(shape), -1).sum(axis=1) * noise**2
    across = np.array([plane != mode.plane for plane in planes])
    alive = np.isfinite(mode.noise)
    inside = float(np.sqrt(np.sum(shape[~across & alive] ** 2)))
    lost = float(np.sqrt(np.sum(of_shape[across & alive])))
    two = set(planes) == set(PLANES)
    return Bound(
        float(np.sqrt(covariance[0, 0])) / (2 * np.pi * mode.frequency_hz),
        (lost / inside if inside > 0 else np.inf) if two else 0.0,
    )


def _poles(modes: tuple[ModeTruth, ...]) -> Complex:
    w = 2 * np.pi * np.array([mode.frequency_hz for mode in modes])
    z = np.array([mode.damping_ratio for mode in modes])
    return np.asarray(-z * w + 1j * w * np.sqrt(1 - z**2))


def ring_down_covariance(modes: tuple[ModeTruth, ...], spans_s: Array) -> list[Array]:
    """Of each mode's angular frequency, decay rate, then shape over the noise (real, imaginary).

    The motion at sensor c after contact h is the sum of b_c a_h exp(s t), real part, for
    `spans_s` (contacts,); in noise of one-sided density S a parameter's derivatives x, y have the
    information 2/S times the integral of x y (S. M. Kay, Estimation Theory, 1993, sec. 3.9).
    """
    poles = _poles(modes)
    rows = [_derivatives(mode) for mode in modes]
    counts = [len(row) for row in rows]
    at = np.concatenate(([0], np.cumsum(counts)))
    information = np.zeros((at[-1], at[-1]))
    for k, one in enumerate(rows):
        for m in range(k, len(rows)):
            if abs(poles[k].imag - poles[m].imag) > -_REACH * 2 * (poles[k] + poles[m]).real:
                continue
            block = _products(one, rows[m], complex(poles[k] + np.conj(poles[m])), spans_s)
            information[at[k] : at[k + 1], at[m] : at[m + 1]] = block
            information[at[m] : at[m + 1], at[k] : at[k + 1]] = block.T
    covariance = _inverse(information)
    shares = [2 + 2 * len(mode.shape) for mode in modes]
    return [covariance[i : i + n, i : i + n] for i, n in zip(at[:-1], shares, strict=True)]


def _derivatives(mode: ModeTruth) -> Complex:
    """By frequency, decay, shape, ringing: (parameters, channels, contacts, power of t: 0, 1).

    Of the ringing, the strongest contact's is held: shape and ringing share one scale.
    """
    shape = np.array(mode.shape) / np.sqrt(mode.noise)
    rings = np.array(mode.rings)
    channels, contacts = len(shape), len(rings)
    whole = shape[:, None] * rings
    first = np.zeros((2, channels, contacts, 2), complex)
    first[0, ..., 1], first[1, ..., 1] = 1j * whole, whole
    of_shape = np.zeros((channels, 2, channels, contacts, 2), complex)
    of_ring = np.zeros((contacts, 2, channels, contacts, 2), complex)
    for part, turn in enumerate((1, 1j)):
        for c in range(channels):
            of_shape[c, part, c, :, 0] = turn * rings
        for h in range(contacts):
            of_ring[h, part, :, h, 0] = turn * shape
    others = np.arange(contacts) != np.argmax(np.abs(rings))
    return np.concatenate([
        first,
        of_shape.reshape(-1, channels, contacts, 2),
        of_ring[others].reshape(-1, channels, contacts, 2),
    ])  # fmt: skip


def _products(one: Complex, other: Complex, u: complex, spans_s: Array) -> Array:
    """Real part of the integrals of every derivative of one mode times those of another."""
    grown = np.exp(u * spans_s)
    integrals = [(grown - 1) / u]
    for power in (1, 2):
        integrals.append((spans_s**power * grown - power * integrals[-1]) / u)
    weights = np.array([[integrals[m + n] for n in (0, 1)] for m in (0, 1)])
    weighted = np.einsum("pchm,mnh->pchn", one, weights)
    return np.asarray(
        (weighted.reshape(len(one), -1) @ other.conj().reshape(len(other), -1).T).real
    )


def _inverse(information: Array) -> Array:
    """Of what nothing is known, the variance becomes very large."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    own = information / scale[:, None] / scale
    own[np.diag_indices_from(own)] += _SINGULAR
    covariance = np.linalg.inv(own) / scale[:, None] / scale
    unknown = np.diag(covariance) <= 0  # rounding, far beyond any use
    covariance[unknown, unknown] = np.inf
    return np.asarray(covariance)


def _in_wind(k: int, modes: tuple[ModeTruth, ...], case: Recording, seconds: float) -> Bound:
    """Of one mode among its neighbours, by the spectra's likelihood (P. Whittle 1953).

    The spectral matrix is each mode's v v' |H|^2 and the noise; parameters x, y have the
    information seconds times the integral of tr(S^-1 dS/dx S^-1 dS/dy).
    """
    mode = modes[k]
    width = mode.damping_ratio * mode.frequency_hz
    reach = 2 * _REACH * width
    near = [m for m in modes if abs(m.frequency_hz - mode.frequency_hz) < 1.5 * reach + width]
    near.sort(key=lambda m: m is not mode)  # the mode itself first
    # Denser where the peak is.
    lines = mode.frequency_hz + reach * np.sinh(np.linspace(-4, 4, _LINES)) / np.sinh(4)
    lines = lines[(lines > 0) & (lines < case.rate_hz / 2)]
    noise = np.array(mode.noise)
    weighted = [_driven(m, seconds) * np.array(m.shape) / np.sqrt(noise) for m in near]
    total = np.eye(len(noise)) + sum(
        _receptance(m, lines)[:, None, None] * np.outer(v, v)
        for m, v in zip(near, weighted, strict=True)
    )
    slopes = np.concatenate([_slopes(m, v, lines) for m, v in zip(near, weighted, strict=True)])
    root = np.linalg.inv(np.linalg.cholesky(total))
    white = np.einsum("lab,plbc,ldc->plad", root, slopes, root)
    white *= np.sqrt(seconds * np.gradient(lines))[:, None, None]
    flat = white.reshape(len(white), -1)
    own = _inverse(flat @ flat.T)[: 2 + len(noise), : 2 + len(noise)]
    own[2:, 2:] /= _driven(mode, seconds) ** 2 + 1e-300
    return _bound(mode, own, case)


def _driven(mode: ModeTruth, seconds: float) -> float:
    """Root of the density of the modal force, from the mode's level above the noise."""
    width = 2 * mode.damping_ratio * mode.frequency_hz
    best = np.max(np.array(mode.shape) ** 2 / np.array(mode.noise))
    mean_square = 10 ** (mode.snr_db / 10) * width / best if best > 0 else 0.0
    # Around the peak |H|^2 has the area pi f / (4 z) (S. H. Crandall and W. D. Mark 1963).
    return float(np.sqrt(mean_square * 4 * mode.damping_ratio / (np.pi * mode.frequency_hz)))


def _receptance(mode: ModeTruth, lines: Array, f: float = 0.0, z: float = 0.0) -> Array:
    """|H|^2 of the acceleration, at frequency and damping that are changed by shares."""
    ratio = (lines / (mode.frequency_hz * (1 + f))) ** 2
    damping = mode.damping_ratio * (1 + z)
    return np.asarray(ratio**2 / ((1 - ratio) ** 2 + 4 * damping**2 * ratio))


def _slopes(mode: ModeTruth, v: Array, lines: Array) -> Array:
    """dS by angular frequency, damping (relative), shape: (parameters, lines, channels, channels).

    The level of the force is in the shape's size.
    """
    step = 1e-3 * mode.damping_ratio
    of_f = (_receptance(mode, lines, f=step) - _receptance(mode, lines, f=-step)) / (2 * step)
    of_z = (_receptance(mode, lines, z=1e-3) - _receptance(mode, lines, z=-1e-3)) / 2e-3
    outer = np.outer(v, v)
    poles = [
        of_f[:, None, None] * outer / (2 * np.pi * mode.frequency_hz),
        of_z[:, None, None] * outer,
    ]
    unit = np.eye(len(v))
    own = _receptance(mode, lines)[:, None, None]
    shapes = [own * (np.outer(v, e) + np.outer(e, v)) for e in unit]
    return np.array(poles + shapes)
