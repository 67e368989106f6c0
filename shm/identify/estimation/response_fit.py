"""Identifier in the frequency domain: a common-denominator fit of the frequency responses.

It shares nothing with subspace identification but the contract: an independent cross-check. The
band is fitted in overlapping parts; model orders rise in all of them together.

In each part every response is a quotient N(z)/D(z) of polynomials in z = exp(s dt), with one D for
all: its roots are the poles. With D linear in the error, D H - N, the numerators drop out of the
normal equations, which are Toeplitz matrices of a few sums over the lines (least-squares complex
frequency: Verboven 2002, 3.3; Peeters, Van der Auweraer, Guillaume and Leuridan 2004, eq. 5 to 15).
Coefficients are complex, so a part away from zero needs no mirror image.

D's scale must be fixed. With its highest coefficient 1 the poles are nearly free of bias but noise
makes stable ones too; with its lowest coefficient 1 those turn unstable, and the true ones are more
damped than they should (Cauberghe et al. 2005). A pole of the first that the second has too is
true.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import NotIdentifiable
from shm.identify.contract import Dropped, Finding, Measurement
from shm.identify.estimation.poles import PoleSet
from shm.identify.estimation.stabilise import final_orders, nothing_moves, stabilised
from shm.identify.options import IdentifyOptions
from shm.values import ComplexArray, FloatArray, IntArray

# judgement: a share of 8 Hz holds a mode or two a plane. With _OVERLAP on both
# sides 40 lines are 100, enough for an order of 40 by _LINES_AN_ORDER
_MOST_PARTS = 13
_LINES_A_SHARE = 40
_OVERLAP = 0.75
"""A part reaches so far into its neighbours, in shares."""
# judgement: a part sees six modes with its neighbours' ends, and six times as many poles leave room
# for noise; eleven orders tell what stays; from two lines an order on noise is averaged
_MAX_ORDER, _ORDER_STEP, _LEAST_ORDER = 36, 3, 6
_LINES_AN_ORDER = 2.5
_LEAST_FORCE = 1e-6  # judgement: 120 dB below the largest is rounding
_CONFIRMED = 0.5
"""The two constraints put a true pole this near, as a share of its distance from the axis."""


@dataclass(frozen=True, eq=False)
class _Responses:
    """H1 of all hits, (points, lines), and with each hit left out, on lines that are known."""

    frequency_hz: FloatArray
    together: ComplexArray
    without_each: tuple[ComplexArray, ...]


@dataclass(frozen=True, eq=False)
class _Fits:
    """Models of one order in all parts, and their poles that count, each in its part's share.

    `model` is D with its highest coefficient 1, (parts, order + 1); `part`, `log_z` (poles,).
    """

    model: ComplexArray
    part: IntArray
    log_z: ComplexArray
    dropped: tuple[Dropped, ...]


def common_denominator_fit(measurement: Measurement, options: IdentifyOptions) -> Finding:
    """Modes of a measurement by a fit of its frequency responses.

    Raises NotIdentifiable where it holds none, or too few lines of them.
    """
    responses = _responses(measurement, options)
    if not np.any(responses.together):
        return nothing_moves(max(1, len(responses.without_each)))
    parts = _parts(responses, options)
    orders = _orders(parts, options)
    decay = _extra_decay(measurement)
    sums = sums_of(parts, responses.together)
    fits = [_fits(parts, sums, order) for order in orders]
    sets = [_pole_set(parts, sums, fit, decay) for fit in fits]
    last = [fit for fit, order in zip(fits, orders, strict=True) if order in final_orders(orders)]
    without_each = []
    for response in responses.without_each:
        fewer = sums_of(parts, response)
        again = [_refitted(fit, fewer) for fit in last]
        without_each.append([_pole_set(parts, fewer, fit, decay) for fit in again])
    return stabilised(sets, without_each, 1 / _spacing(responses), options)


def _responses(measurement: Measurement, options: IdentifyOptions) -> _Responses:
    given, spectra = measurement.frequency_response, measurement.spectra
    if given is None:
        raise NotIdentifiable(
            "identifier 'frf' needs frequency responses, and nobody hit.",
            file=measurement.source,
            remedy="Use the identifier 'ssi'.",
        )
    if spectra is None:
        responses = _Responses(given.frequency_hz, given.accelerance, ())
    else:
        cross, force = spectra[:, :1].conj() * spectra[:, 1:], np.abs(spectra[:, :1]) ** 2
        quiet = np.sum(force, axis=0) <= _LEAST_FORCE**2 * np.max(np.sum(force, axis=0))
        force = np.where(quiet, np.nan, force)
        hits = range(len(spectra)) if len(spectra) > 1 else ()
        responses = _Responses(
            given.frequency_hz,
            cross.sum(axis=0) / force.sum(axis=0),
            tuple(_mean_without(hit, cross) / _mean_without(hit, force) for hit in hits),
        )
    return _known(responses, measurement.source, options)


def _mean_without(hit: int, spectra: ComplexArray | FloatArray) -> ComplexArray:
    return np.asarray(np.delete(spectra, hit, axis=0).sum(axis=0), dtype=np.complex128)


def _known(responses: _Responses, source: str, options: IdentifyOptions) -> _Responses:
    """On the lines, above zero, on which all responses are finite."""
    every = (responses.together, *responses.without_each)
    good = np.all([np.all(np.isfinite(each), axis=0) for each in every], axis=0)
    good &= responses.frequency_hz > 0
    inside = responses.frequency_hz[good]
    inside = inside[(inside >= options.band_low_hz) & (inside <= options.band_high_hz)]
    if len(inside) < _LINES_AN_ORDER * _LEAST_ORDER:
        raise NotIdentifiable(
            f"{len(inside)} lines of the frequency responses lie in the band: too few to fit.",
            file=source,
            remedy="Record longer after each hit, or widen the band.",
        )
    return _Responses(
        responses.frequency_hz[good],
        responses.together[:, good],
        tuple(each[:, good] for each in responses.without_each),
    )


def _spacing(responses: _Responses) -> float:
    return float(np.min(np.diff(responses.frequency_hz)))


def _parts(responses: _Responses, options: IdentifyOptions) -> list[Part]:
    """Equal shares of the band, each fitted on lines that reach into its neighbours."""
    frequency_hz = responses.frequency_hz
    low, high = options.band_low_hz, min(options.band_high_hz, float(frequency_hz[-1]))
    lines = (high - low) / _spacing(responses)
    count = int(np.clip(lines // _LINES_A_SHARE, 1, _MOST_PARTS))
    edges = np.linspace(low, high, count + 1)
    reach = _OVERLAP * (edges[1] - edges[0])
    first = np.searchsorted(frequency_hz, edges[:-1] - reach)
    last = np.searchsorted(frequency_hz, edges[1:] + reach, side="right")
    # The last share holds the upper end of the band itself.
    edges[-1] = math.inf
    return [
        part_of(
            frequency_hz,
            responses.together,
            (float(edges[k]), float(edges[k + 1])),
            slice(int(first[k]), int(last[k])),
            _MAX_ORDER,
        )
        for k in range(count)
    ]


def _orders(parts: Sequence[Part], options: IdentifyOptions) -> list[int]:
    fewest = min(len(part.powers) for part in parts)
    highest = min(options.max_order or _MAX_ORDER, _MAX_ORDER, int(fewest / _LINES_AN_ORDER))
    return list(range(highest, _LEAST_ORDER - 1, -_ORDER_STEP))[::-1] or [highest]


def _extra_decay(measurement: Measurement) -> float:
    """Decay of the responses' window beyond that of the ring-downs', in rad/s.

    Poles are given the damping that they have in the ring-downs, as those of any identifier.
    """
    ring_downs, responses = measurement.decay_time_constant_s, measurement.window_time_constant_s
    return 1 / responses - 1 / ring_downs


def _fits(parts: Sequence[Part], sums: Sums, order: int) -> _Fits:
    both = denominators(sums, order)
    first, second = roots(both)
    distance = np.abs(first[:, :, np.newaxis] - second[:, np.newaxis, :])
    nearest = np.argmin(distance, axis=2)
    partner = np.take_along_axis(second, nearest, axis=1)
    depth = np.maximum(-first.real, -partner.real)
    confirmed = np.min(distance, axis=2) < _CONFIRMED * depth
    frequency_hz = _rates(parts, np.arange(len(parts))[:, np.newaxis], first).imag / (2 * math.pi)
    low, high = (np.array([[getattr(p, end)] for p in parts]) for end in ("low_hz", "high_hz"))
    own = (frequency_hz >= low) & (frequency_hz < high)
    part, column = np.nonzero(own & confirmed)
    elsewhere = Dropped("poles", int(np.sum(~own)), "outside of their part's share of the band")
    unsure = Dropped(
        "poles", int(np.sum(own & ~confirmed)), "not confirmed by the other scale of the polynomial"
    )
    return _Fits(both.highest, part, first[part, column], (elsewhere, unsure))


def _rates(parts: Sequence[Part], part: IntArray, log_z: ComplexArray) -> ComplexArray:
    """Poles in rad/s from ln z."""
    step_s = np.array([p.step_s for p in parts])[part]
    centre_hz = np.array([p.centre_hz for p in parts])[part]
    return np.asarray(log_z / step_s + 2j * math.pi * centre_hz)


def _refitted(fits: _Fits, sums: Sums) -> _Fits:
    """The same poles in models of other sums: they move little, so Newton's method finds them."""
    model = denominators(sums, fits.model.shape[1] - 1).highest
    log_z = polished(model[fits.part], fits.log_z)
    found = np.isfinite(log_z)
    return replace(fits, model=model, part=fits.part[found], log_z=log_z[found])


def _pole_set(parts: Sequence[Part], sums: Sums, fits: _Fits, extra_decay: float) -> PoleSet:
    rates = _rates(parts, fits.part, fits.log_z) + extra_decay
    return PoleSet(
        order=fits.model.shape[1] - 1,
        frequency_hz=np.abs(rates) / (2 * np.pi),
        damping_ratio=-rates.real / np.abs(rates),
        shapes=residues(sums, fits.model, fits.part, fits.log_z),
        dropped=fits.dropped,
    )


_GUARD = 1.15
"""The circle of z is this much longer than a part of the band: its ends do not meet."""
_MIXES = 6  # judgement: as many sums as a part sees modes; further ones are noise
_LONGEST_STEP = 0.5
"""Of ln z in Newton's method, where the whole circle is 2 pi long."""
_RIDGE = 1e-14
"""Keeps the normal equations solvable where responses hold no noise, as a share of their size."""


@dataclass(frozen=True, eq=False)
class Part:
    """A part of the band: its own share, `low_hz` to `high_hz`, and the `lines` that are fitted.

    `powers` (lines, 2 * order + 1): z to the power -order, ..., order; `mixing` (mixes, points):
    the few sums of responses that carry most of them.
    """

    low_hz: float
    high_hz: float
    lines: slice
    centre_hz: float
    step_s: float
    powers: ComplexArray
    mixing: ComplexArray


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over the lines of the parts times powers of z.

    `unit`, `power` (parts, powers) of one and of the squared responses; `mixes` (parts, mixes,
    powers), `points` (parts, points, powers) of responses.
    """

    unit: ComplexArray
    power: ComplexArray
    mixes: ComplexArray
    points: ComplexArray


@dataclass(frozen=True, eq=False)
class Denominators:
    """D of each part with its highest, and with its lowest coefficient 1, (parts, order + 1)."""

    highest: ComplexArray
    lowest: ComplexArray


def part_of(
    frequency_hz: FloatArray,
    response: ComplexArray,
    share_hz: tuple[float, float],
    lines: slice,
    max_order: int,
) -> Part:
    """The part of a band that fits `lines` of `response` (points, lines) for its share of it."""
    inside = frequency_hz[lines]
    step_s = float(1 / (_GUARD * np.ptp(inside)))
    centre_hz = float(inside[0] + inside[-1]) / 2
    exponents = np.arange(-max_order, max_order + 1)
    powers = np.exp(2j * np.pi * step_s * np.outer(inside - centre_hz, exponents))
    left = np.linalg.svd(response[:, lines], full_matrices=False)[0]
    return Part(*share_hz, lines, centre_hz, step_s, powers, left[:, :_MIXES].conj().T)


def sums_of(parts: list[Part], response: ComplexArray) -> Sums:
    """The sums of `response` (points, lines) that the fits of all orders are made of."""
    points = np.array([response[:, part.lines] @ part.powers for part in parts])
    mixed = [part.mixing @ response[:, part.lines] for part in parts]
    squares = [np.sum(np.abs(m) ** 2, axis=0) for m in mixed]
    return Sums(
        unit=np.array([part.powers.sum(axis=0) for part in parts]),
        power=np.array([s @ part.powers for s, part in zip(squares, parts, strict=True)]),
        mixes=np.array([m @ part.powers for m, part in zip(mixed, parts, strict=True)]),
        points=points,
    )


def _toeplitz(sums: ComplexArray, order: int) -> ComplexArray:
    """Sum over lines of conj(z^i) h z^j, (..., order + 1, order + 1), from those of h z^(j - i)."""
    index = np.arange(order + 1)
    return np.asarray(sums[..., sums.shape[-1] // 2 + index - index[:, np.newaxis]])


def denominators(sums: Sums, order: int) -> Denominators:
    """D of that order in each part, under both constraints."""
    parts, mixes = sums.mixes.shape[:2]
    size = order + 1
    unit, cross = _toeplitz(sums.unit, order), _toeplitz(sums.mixes, order)
    columns = cross.transpose(0, 2, 1, 3).reshape(parts, size, mixes * size)
    numerators = np.linalg.solve(unit, columns).reshape(parts, size, mixes, size)
    explained = cross.reshape(parts, -1, size).conj().transpose(0, 2, 1) @ (
        numerators.transpose(0, 2, 1, 3).reshape(parts, -1, size)
    )
    normal = _toeplitz(sums.power, order)
    ridge = _RIDGE * normal[:, :1, :1] * np.eye(size)
    reduced = normal - explained + ridge
    one = np.ones((parts, 1))
    highest = np.linalg.solve(reduced[:, :-1, :-1], -reduced[:, :-1, -1:])[..., 0]
    lowest = np.linalg.solve(reduced[:, 1:, 1:], -reduced[:, 1:, :1])[..., 0]
    return Denominators(np.hstack([highest, one]), np.hstack([one, lowest]))


def roots(found: Denominators) -> tuple[ComplexArray, ComplexArray]:
    """ln z of the roots under the two constraints, each (parts, order)."""
    # Reversed, the second has leading coefficient 1 too; its roots are the reciprocals.
    both = np.concatenate([found.highest, found.lowest[:, ::-1]])
    order = both.shape[1] - 1
    companion = np.zeros((len(both), order, order), dtype=complex)
    companion[:, np.arange(1, order), np.arange(order - 1)] = 1
    companion[:, :, -1] = -both[:, :-1]
    first, second = np.split(np.log(np.linalg.eigvals(companion)), 2)
    return first, -second


def polished(highest: ComplexArray, log_z: ComplexArray, rounds: int = 3) -> ComplexArray:
    """ln z (poles,) moved onto roots of polynomials `highest` (poles, order + 1), by Newton.

    NaN where a step leads far away: there is no root near.
    """
    exponents = np.arange(highest.shape[1])
    lost = np.zeros(log_z.shape, dtype=bool)
    for _ in range(rounds):
        powers = highest * np.exp(log_z[:, np.newaxis] * exponents)
        step = powers.sum(axis=1) / (powers @ exponents)
        lost |= np.abs(step) > _LONGEST_STEP
        log_z = np.where(lost, log_z, log_z - step)
    return np.where(lost, np.nan, log_z)


def residues(
    sums: Sums, highest: ComplexArray, part: IntArray, log_z: ComplexArray
) -> ComplexArray:
    """Residues at poles (poles,) of the parts `part` (poles,), unscaled, (points, poles).

    They are the numerators at the poles: N of least squares for the D that is known.
    """
    order = highest.shape[1] - 1
    right = (_toeplitz(sums.points, order) @ highest[:, np.newaxis, :, np.newaxis])[..., 0]
    numerators = np.linalg.solve(_toeplitz(sums.unit, order), right.transpose(0, 2, 1))
    powers = np.exp(log_z[:, np.newaxis] * np.arange(order + 1))
    return np.asarray(np.einsum("ki,kio->ok", powers, numerators[part]))
