"""Where the description puts the modes of a hanger, and how they go with what tests differ by."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence

import numpy as np

from shm.models import Model
from shm.models.base import Conditions
from shm.values import PLANES, FloatArray, IntArray, ModalTest, Mode, Plane
from shm.watch.mistaken_modes import log_mixture

Key = tuple[Plane, int]

_TENSION_STEP, _DECADES_STEP = 0.02, 0.1  # technical: of finite differences
_FARTHEST_TENSION, _FARTHEST_DECADES = 0.4, 1.0  # technical: beyond it nothing is linearised
_DRAWS = 4000  # of the description: technical, refined below
_NARROWER = (0.3, 0.1, 0.03)  # technical: of the prior's range, about the best draw
_HELD = 1e-9  # of a parameter that is not drawn
# Where slopes are taken: a tension near the nominal one, the length as taped with its fittings, and
# springs that bend with the bar. Judgement; what differs from test to test is the same anywhere.
_PLAUSIBLE = {"theta_F": (1.0, 0.3), "theta_L": (1.0, 0.02)}
_SPRING, _SAME_PLANE = "log10_k", ("13", "24")
_FELT, _FELT_SD = 3.0, 0.7
_MODEL_SD = 0.01  # judgement: of a frequency, a class beside a bar as made


def fit_description(
    model: Model, measured: FloatArray, planes: IntArray, orders: IntArray, conditions: Conditions
) -> tuple[FloatArray, FloatArray]:
    """The likeliest parameter set of the description, and what the modes (n,) are off from it."""
    rng = np.random.default_rng(0)
    lower, upper = model.prior.lower, model.prior.upper
    theta = lower + (upper - lower) * rng.random((_DRAWS, len(lower)))
    best, off = _best(model, theta, measured, planes, orders, conditions)
    for width in _NARROWER:
        near = best + width * (upper - lower) * rng.uniform(-1, 1, (_DRAWS // 4, len(lower)))
        theta = np.vstack([best, np.clip(near, lower, upper)])
        best, off = _best(model, theta, measured, planes, orders, conditions)
    return best, off


def _best(
    model: Model,
    theta: FloatArray,
    measured: FloatArray,
    planes: IntArray,
    orders: IntArray,
    conditions: Conditions,
    held: FloatArray | float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Return the likeliest of parameter sets, a few modes being mistaken, and what it is off by.

    `held` (n,) is the log density of what is known of the sets beforehand.
    """
    found = model.frequencies_at(theta, int(orders.max()) + 1, conditions)
    off = measured - np.log(found[:, planes, orders])
    total = log_mixture(off, _MODEL_SD**2).sum(axis=1)
    at = int(np.nanargmax(total + held))
    return theta[at], off[at]


def typical_parameters(
    model: Model, level: FloatArray, planes: IntArray, orders: IntArray
) -> FloatArray:
    """A parameter set near the description at which the median test lies, to take slopes at.

    Frequencies alone leave tension, length and ends to each other: what fits best may be a loose
    bar with one end free, whose springs move nothing. Both ends are taken as alike, and where a
    spring is felt.
    """
    rng, prior, names = np.random.default_rng(0), model.prior, model.parameter_names
    best, width = (prior.lower + prior.upper) / 2, (prior.upper - prior.lower) / 2
    for name, (usual, sd) in _PLAUSIBLE.items():
        if name in names:
            best[names.index(name)], width[names.index(name)] = usual, sd
    for column, name in enumerate(names):
        with contextlib.suppress(KeyError):
            best[column], width[column] = model.usual(name), 0.0
    springs = [n for n, name in enumerate(names) if name.startswith(_SPRING)]
    best[springs] = math.log10(_FELT * model.wave_stiffness_n_m_rad(1))
    width[springs] = _FELT_SD
    centre, bounds = best.copy(), (prior.lower, prior.upper)
    for share in (1.0, *_NARROWER):
        draws = share * width * rng.standard_normal((_DRAWS // 4, len(names)))
        draws[:, springs] = _alike_ends(draws[:, springs], [names[n] for n in springs])
        theta = np.clip(np.vstack([best, best + draws]), *bounds)
        held = -(((theta - centre) / np.maximum(width, _HELD)) ** 2).sum(axis=1) / 2
        best, _ = _best(model, theta, level, planes, orders, Conditions(), held)
    return best


def _alike_ends(draws: FloatArray, names: Sequence[str]) -> FloatArray:
    """Draws (n, springs) where those of one plane go together, as far as their names tell."""
    pairs = [[n for n, name in enumerate(names) if name[-1] in ends] for ends in _SAME_PLANE]
    alike = draws.copy()
    for pair in pairs:
        alike[:, pair] = draws[:, pair[:1]]
    return alike


class Quantities:
    """What tests of one hanger may differ by, and the log frequencies (keys,) that follow."""

    def __init__(self, model: Model, base: FloatArray, planes: IntArray, orders: IntArray):
        self._model, self._base, self._planes, self._orders = model, base, planes, orders
        names = model.parameter_names
        self._tension = names.index("theta_F")
        self._springs = [n for n, name in enumerate(names) if name.startswith(_SPRING)]
        self.count = 2 + len(self._springs)

    def log_frequency(self, x: FloatArray, conditions: Conditions) -> FloatArray:
        return np.asarray(self._predicted(x[None], conditions)[0])

    def slopes(self, x: FloatArray, conditions: Conditions) -> FloatArray:
        """(keys, q), by central differences."""
        steps = np.array([1.0, _TENSION_STEP, *[_DECADES_STEP] * len(self._springs)])
        both = np.vstack([x + np.diag(steps), x - np.diag(steps)])
        up, down = np.split(self._predicted(both, conditions), 2)
        return np.asarray(((up - down) / (2 * steps[:, None])).T)

    def _predicted(self, x: FloatArray, conditions: Conditions) -> FloatArray:
        theta = np.tile(self._base, (len(x), 1))
        tension = np.clip(x[:, 1], -_FARTHEST_TENSION, _FARTHEST_TENSION)
        theta[:, self._tension] *= np.exp(tension)
        prior, springs = self._model.prior, self._springs
        decades = np.clip(x[:, 2:], -_FARTHEST_DECADES, _FARTHEST_DECADES)
        theta[:, springs] = np.clip(
            theta[:, springs] + decades, prior.lower[springs], prior.upper[springs]
        )
        found = self._model.frequencies_at(theta, int(self._orders.max()) + 1, conditions)
        return np.asarray(np.log(found[:, self._planes, self._orders]) + x[:, :1])


def places(keys: Sequence[Key]) -> tuple[IntArray, IntArray]:
    planes = np.array([PLANES.index(plane) for plane, _ in keys])
    return planes, np.array([order - 1 for _, order in keys])


def known_modes(test: ModalTest) -> list[Mode]:
    return [mode for mode in test.regular_modes if mode.frequency_hz > 0]
