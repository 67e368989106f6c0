"""Compare mode shapes, and make complex ones real."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.values import ComplexArray, FloatArray


def collinearity(shape: ComplexArray) -> FloatArray:
    """Return the modal phase collinearity (...) of complex shapes (..., channels), 1 in phase.

    Pappa, Elliott and Schenk (1993), eq. 3 to 7, without the removal of the mean.
    """
    real, imaginary = shape.real, shape.imag
    xx, yy = np.sum(real**2, axis=-1), np.sum(imaginary**2, axis=-1)
    xy = np.sum(real * imaginary, axis=-1)
    total = xx + yy
    return np.asarray(((xx - yy) ** 2 + 4 * xy**2) / np.where(total > 0, total, np.inf) ** 2)


def real_shape(shape: ComplexArray) -> FloatArray:
    """Return `shape` (channels,) rotated to be most real, its largest value 1."""
    turned = (shape * np.exp(-0.5j * np.angle(np.sum(shape**2)))).real
    return np.asarray(turned / turned[np.argmax(np.abs(turned))])


def modal_assurance(one: FloatArray, other: FloatArray) -> float:
    """Return the modal assurance criterion of two real shapes (channels,); 1 for one channel.

    Allemang and Brown (1982).
    """
    return float((one @ other) ** 2 / ((one @ one) * (other @ other)))


def aligned(shape: FloatArray, reference: FloatArray) -> FloatArray:
    """Scale `shape` (channels,) to fit `reference` best by least squares."""
    return np.asarray(shape * (shape @ reference) / (shape @ shape))


def median_shape(shapes: Sequence[ComplexArray]) -> FloatArray:
    """Return the median over complex shapes (channels,) made real, its largest value 1."""
    given = np.array(shapes)
    turn = np.exp(-0.5j * np.angle(np.sum(given**2, axis=1, keepdims=True)))
    real = (given * turn).real
    # By least squares to the last one, whose own scale is taken out at the end.
    scale = (real @ real[-1]) / np.sum(real**2, axis=1)
    middle = np.median(scale[:, np.newaxis] * real, axis=0)
    return np.asarray(middle / middle[np.argmax(np.abs(middle))])
