"""Join the shapes of several set-ups: products of two factors, as far as measured.

After a hit the residue of a mode is its shape at the sensor times its shape at the hammer (Ewins
2000, section 2.4). All set-ups together fill a table with a row for each hammer position and a
column for each sensor, whose factors are the shape at the sensors and, by reciprocity, at the
hammer's positions. Without a force a set-up's shape has an unknown scale, which takes the hammer's
place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.errors import BadInput
from shm.identify.contract import FoundMode, Measurement, Place, place_of
from shm.identify.estimation.spread import jackknife_sd
from shm.identify.setup_merging.modal_participation import Ringing
from shm.values import BoolArray, FloatArray, FrequencyResponse, Plane, ResponsePoint

_TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Shapes:
    """Shapes of all modes over `points`: `values` and their standard deviations (modes, points)."""

    points: tuple[ResponsePoint, ...]
    values: FloatArray
    sds: FloatArray


@dataclass(frozen=True, eq=False)
class Product:
    """One set-up's part: `values` and standard deviations `sds`, both (modes, points)."""

    values: FloatArray
    sds: FloatArray


def of_hits(ring: Ringing) -> Product:
    """Return the residues, averaged over the hits."""
    known = ring.residue[np.isfinite(ring.residue).all(axis=(1, 2))]
    others = (known.sum(axis=0) - known) / max(len(known) - 1, 1)
    return Product(known.mean(axis=0).T, jackknife_sd(others).T)


def of_seen_shapes(modes: Sequence[FoundMode], seen: Sequence[bool]) -> Product:
    """Return shapes of modes `seen` by the set-up, certain ones larger; 0 for the others.

    They are free of what modes beyond the band leave in residues, but give no scales.
    """
    values, sds = np.zeros((2, len(modes), max(len(mode.shape) for mode in modes)))
    for index, (mode, each) in enumerate(zip(modes, seen, strict=True)):
        if each:
            values[index] = _certainty(mode) * mode.shape
            sds[index] = _certainty(mode) * mode.shape_sd
    return Product(values, sds)


def _certainty(mode: FoundMode) -> float:
    """Return 1 over the mean standard deviation of a shape; 1 where it is not known."""
    sd = float(np.mean(mode.shape_sd))
    return 1 / sd if sd > 0 else 1.0


def of_shapes(modes: Sequence[FoundMode]) -> Product:
    """Return the shapes as they are."""
    return Product(np.array([m.shape for m in modes]), np.array([m.shape_sd for m in modes]))


def joined_shapes(measurements: Sequence[Measurement], products: Sequence[Product]) -> Shapes:
    """Return the shapes over all points of all set-ups, the largest value 1.

    The points are the sensors', or the hammer's where it hit at more places than there are
    sensors. Raises BadInput where set-ups share neither the hammer's place nor a sensor's.
    """
    table = _table(measurements, products)
    if not hang_together(table.known):
        raise BadInput(
            "the set-ups share neither the hammer's place nor a sensor's.",
            file=measurements[-1].source,
            remedy="Leave the hammer or one sensor where it is, or identify set-ups one by one.",
        )
    at_hammer, at_sensor = factors(table.values, table.known)
    if hammer_roves(measurements):
        sds = _sds(table.variances, at_sensor, table.known)
        shapes = _along_hammer(table, at_hammer, sds, at_sensor)
    else:
        sds = _sds(table.variances.transpose(0, 2, 1), at_hammer, table.known.T)
        shapes = Shapes(tuple(table.sensors.values()), at_sensor, sds)
    largest = np.take_along_axis(
        shapes.values, np.argmax(np.abs(shapes.values), axis=1)[:, np.newaxis], axis=1
    )
    return Shapes(shapes.points, shapes.values / largest, shapes.sds / np.abs(largest))


def hammer_roves(measurements: Sequence[Measurement]) -> bool:
    """Return whether the hammer hit at more places along the hanger than there are sensors."""
    hammers = {m.hammer.x_m for m in measurements if m.hammer}
    return len(hammers) > len({point.x_m for m in measurements for point in m.points})


def joined_response(measurements: Sequence[Measurement]) -> FrequencyResponse | None:
    """Return the frequency responses of all set-ups as one; None without a force.

    Where the hammer roves, its place is the point.
    """
    responses = [m.frequency_response for m in measurements if m.frequency_response is not None]
    if len(responses) < 2:
        return responses[0] if responses else None
    coherences = [r.coherence for r in responses if r.coherence is not None]
    roves = hammer_roves(measurements)
    return replace(
        responses[0],
        points=tuple(
            _at_hammer(m.hammer, point) if roves and m.hammer else point
            for m in measurements
            for point in m.points
        ),
        accelerance=np.vstack([response.accelerance for response in responses]),
        coherence=np.vstack(coherences) if len(coherences) == len(responses) else None,
    )


def _at_hammer(hammer: ResponsePoint, sensor: ResponsePoint) -> ResponsePoint:
    name = f"{sensor.name}, hit at {hammer.x_m:g} m"
    return ResponsePoint(name, hammer.plane or sensor.plane, hammer.x_m)


@dataclass(frozen=True, eq=False)
class _Table:
    """Mean products and variances (modes, rows, columns); `known` (rows, columns).

    `hammers` are the places of the rows, `sensors` those of the columns.
    """

    hammers: dict[Place, ResponsePoint]
    sensors: dict[Place, ResponsePoint]
    values: FloatArray
    variances: FloatArray
    known: BoolArray


def _table(measurements: Sequence[Measurement], products: Sequence[Product]) -> _Table:
    rows = [m.hammer or ResponsePoint(f"set-up {n}") for n, m in enumerate(measurements)]
    hammers = {place_of(row): row for row in rows}
    sensors = {place_of(point): point for m in measurements for point in m.points}
    shape = (len(products[0].values), len(hammers), len(sensors))
    values, variances, counts = np.zeros(shape), np.zeros(shape), np.zeros(shape[1:])
    for row, measurement, product in zip(rows, measurements, products, strict=True):
        r = list(hammers).index(place_of(row))
        for column, point in enumerate(measurement.points):
            c = list(sensors).index(place_of(point))
            values[:, r, c] += product.values[:, column]
            variances[:, r, c] += product.sds[:, column] ** 2
            counts[r, c] += 1
    often = np.maximum(counts, 1)
    return _Table(hammers, sensors, values / often, variances / often**2, counts > 0)


def _sds(variances: FloatArray, other: FloatArray, known: BoolArray) -> FloatArray:
    """Return standard deviations (modes, rows) of the rows' least-squares factor, given `other`."""
    weights = np.where(known, other[:, np.newaxis, :] ** 2, 0.0)
    spread = np.sum(weights * np.where(known, variances, 0.0), axis=2)
    return np.asarray(np.sqrt(spread) / np.maximum(np.sum(weights, axis=2), _TINY))


def _along_hammer(
    table: _Table, at_hammer: FloatArray, sds: FloatArray, at_sensor: FloatArray
) -> Shapes:
    """Return shapes at the hammer's positions; in each sensor plane if its plane is unknown."""
    planes = [point.plane for point in table.sensors.values()]
    points, values, spreads = [], [], []
    for row, hammer in enumerate(table.hammers.values()):
        for plane in [hammer.plane] if hammer.plane else dict.fromkeys(planes):
            share = np.ones(len(at_sensor)) if hammer.plane else _share(at_sensor, planes, plane)
            points.append(replace(hammer, plane=plane))
            values.append(at_hammer[:, row] * share)
            spreads.append(sds[:, row] * np.abs(share))
    return Shapes(tuple(points), np.array(values).T, np.array(spreads).T)


def _share(
    at_sensor: FloatArray, planes: Sequence[Plane | None], plane: Plane | None
) -> FloatArray:
    """Return the motion of each mode (modes,) in `plane`, with the sign of the largest."""
    part = at_sensor[:, [each == plane for each in planes]]
    largest = np.take_along_axis(part, np.argmax(np.abs(part), axis=1)[:, np.newaxis], axis=1)
    return np.asarray(np.sign(largest[:, 0]) * np.linalg.norm(part, axis=1))


# technical: until the shapes stand still far below their standard deviations, 1e-4 at best
_MOST_ROUNDS = 200
_TOLERANCE = 1e-9


def hang_together(known: BoolArray) -> bool:
    """Return whether the known entries (rows, columns) are joined by steps along rows and columns.

    Only then all entries of a factor have one scale.
    """
    rows, columns = known.shape
    places = np.nonzero(known)
    graph = scipy.sparse.csr_array(
        (np.ones(len(places[0])), (places[0], rows + places[1])), shape=2 * (rows + columns,)
    )
    return bool(scipy.sparse.csgraph.connected_components(graph, directed=False)[0] == 1)


def factors(products: FloatArray, known: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return factors (modes, rows), (modes, columns) of `products` (modes, rows, columns).

    Only the `known` entries (rows, columns) count. By turns each factor is the least-squares
    solution given the other; the second has the norm 1.
    """
    values = np.where(known, products, 0.0)
    column = _first_guess(values)
    row = np.zeros(values.shape[:2])
    for _ in range(_MOST_ROUNDS):
        row = np.einsum("mrc,mc->mr", values, column) / _energy(column, known.T)
        new = np.einsum("mrc,mr->mc", values, row) / _energy(row, known)
        new /= np.maximum(np.linalg.norm(new, axis=1, keepdims=True), _TINY)
        change = np.max(np.abs(new - column), initial=0.0)
        column = new
        if change < _TOLERANCE:
            break
    return row, column


def _first_guess(values: FloatArray) -> FloatArray:
    """Return the largest row of each mode; unknown columns are 0 and do not count at first."""
    largest = np.argmax(np.sum(values**2, axis=2), axis=1)
    return np.asarray(values[np.arange(len(values)), largest])


def _energy(factor: FloatArray, known: BoolArray) -> FloatArray:
    return np.asarray(np.maximum(factor**2 @ known, _TINY))
