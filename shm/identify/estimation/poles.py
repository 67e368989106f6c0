"""Poles of state-space models, and how real their shapes are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shm.identify.contract import Dropped
from shm.identify.options import IdentifyOptions
from shm.values import ComplexArray, FloatArray

BoolArray: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class PoleSet:
    """The oscillating poles of one model order.

    `frequency_hz`, `damping_ratio` (poles,); `shapes` (channels, poles), complex, unscaled. A
    pair of conjugate poles counts once. `dropped` counts the order's other poles.
    """

    order: int
    frequency_hz: FloatArray
    damping_ratio: FloatArray
    shapes: ComplexArray
    dropped: tuple[Dropped, ...] = ()

    def chosen(self, keep: BoolArray) -> PoleSet:
        """The poles where `keep` (poles,) is true."""
        return PoleSet(
            self.order,
            self.frequency_hz[keep],
            self.damping_ratio[keep],
            self.shapes[:, keep],
            self.dropped,
        )


def poles_of(
    state: FloatArray, output: FloatArray, sampling_rate_hz: float, shift_hz: float = 0.0
) -> PoleSet:
    """The poles above the real axis of x[k+1] = state x[k], y = output x, raised by `shift_hz`."""
    values, vectors = np.linalg.eig(state)
    above = values.imag > 0
    real = len(values) - 2 * int(np.sum(above))
    lowered = np.log(values[above].astype(np.complex128)) * sampling_rate_hz
    rates = lowered + 2j * np.pi * shift_hz
    return PoleSet(
        order=len(state),
        frequency_hz=np.abs(rates) / (2 * np.pi),
        damping_ratio=-rates.real / np.abs(rates),
        shapes=output @ vectors[:, above],
        dropped=(Dropped("poles", real, "do not oscillate"),),
    )


def in_band(poles: PoleSet, options: IdentifyOptions) -> BoolArray:
    """Which poles lie in the band, (poles,)."""
    return np.asarray(
        (poles.frequency_hz >= options.band_low_hz) & (poles.frequency_hz <= options.band_high_hz)
    )


def plausibly_damped(poles: PoleSet, options: IdentifyOptions) -> BoolArray:
    """Which poles decay, and no faster than a hanger's mode, (poles,)."""
    return np.asarray((poles.damping_ratio > 0) & (poles.damping_ratio < options.max_damping_ratio))


def collinearity(shape: ComplexArray) -> FloatArray:
    """Modal phase collinearity (...) of complex shapes (..., channels): 1 where all phases agree.

    Pappa, Elliott and Schenk (1993), eq. 3 to 7, without the removal of the mean.
    """
    real, imaginary = shape.real, shape.imag
    xx, yy = np.sum(real**2, axis=-1), np.sum(imaginary**2, axis=-1)
    xy = np.sum(real * imaginary, axis=-1)
    total = xx + yy
    return np.asarray(((xx - yy) ** 2 + 4 * xy**2) / np.where(total > 0, total, np.inf) ** 2)


def real_shape(shape: ComplexArray) -> FloatArray:
    """`shape` (channels,) turned to be as real as it can, its largest value 1."""
    turned = (shape * np.exp(-0.5j * np.angle(np.sum(shape**2)))).real
    return np.asarray(turned / turned[np.argmax(np.abs(turned))])


def modal_assurance(one: FloatArray, other: FloatArray) -> float:
    """Modal assurance criterion of two real shapes (channels,); 1 of shapes at a single channel.

    Allemang and Brown (1982).
    """
    return float((one @ other) ** 2 / ((one @ one) * (other @ other)))


def aligned(shape: FloatArray, reference: FloatArray) -> FloatArray:
    """`shape` (channels,) scaled to fit `reference` best, by least squares."""
    return np.asarray(shape * (shape @ reference) / (shape @ shape))


def median_shape(shapes: Sequence[ComplexArray]) -> FloatArray:
    """Median over complex shapes (channels,) made real, its largest value 1."""
    given = np.array(shapes)
    turn = np.exp(-0.5j * np.angle(np.sum(given**2, axis=1, keepdims=True)))
    real = (given * turn).real
    # By least squares to the last one, whose own scale is taken out at the end.
    scale = (real @ real[-1]) / np.sum(real**2, axis=1)
    middle = np.median(scale[:, np.newaxis] * real, axis=0)
    return np.asarray(middle / middle[np.argmax(np.abs(middle))])
