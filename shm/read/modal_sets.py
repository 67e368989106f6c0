"""Modes that another program identified: UFF data sets of type 55, with the places of their nodes.

Type 55, analysis 2 (normal mode) or 3 and 7 (complex eigenvalue), shapes of three or six degrees of
freedom: https://www.ceas3.uc.edu/sdrluff/ (Data at Nodes). Nodes lie along the axis in which they
are furthest apart; lengths are in the units of data set 164, in m without one.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from shm.errors import BadInput
from shm.read.content import bytes_of, plain_file
from shm.read.universal_sets import NODES, opened, read_set, refuse_cut_off
from shm.values import NAN, FloatArray, ShapePoint

# Data sets 55 and 164; the kinds of analysis are field 2 of record 6 of set 55.
_MODES, _UNITS = 55, 164
_NORMAL, _COMPLEX = 2, (3, 7)
_AXES = "xyz"
_MOST_MODES = 500  # judgement: far more than any hanger has in a test
_MOST_DAMPING = 0.5  # judgement: of critical; no hanger rings with more, so it is another unit


@dataclass(frozen=True)
class ForeignModalMode:
    """A mode as another program gives it; `axis` is "x", "y" or "z", along which it moves most.

    `points` are along the hanger: `value` along `axis`, `cross` along the other; both normalised by
    the largest; none where the file places no node. `damping_ratio` is NaN where it is not said.
    """

    frequency_hz: float
    damping_ratio: float
    axis: str
    points: tuple[ShapePoint, ...]

    @property
    def half_waves(self) -> int:
        """Return the number of sign changes of the shape plus one; 0 with too few points."""
        values = [point.value for point in self.points]
        signs = [value > 0 for value in values if abs(value) > _NODE * max(map(abs, values))]
        return 1 + sum(a != b for a, b in pairwise(signs)) if signs else 0


_NODE = 0.02  # judgement: of the largest; smaller values have a sign by chance


@dataclass(frozen=True)
class ForeignModes:
    """The modes of a file, by frequency; `program` is what its first line says."""

    source: str
    program: str
    modes: tuple[ForeignModalMode, ...]


def foreign_modes(path: Path) -> ForeignModes | None:
    """Return the modes in a UFF file; None where it has none. Raises BadInput for damage."""
    raw = bytes_of(path)
    refuse_cut_off(raw, path)
    quiet = warnings.catch_warnings()
    with quiet, np.errstate(all="ignore"), plain_file(path, raw) as plain:
        warnings.simplefilter("ignore")
        file = opened(plain, path)
        kinds = [int(kind) for kind in file.get_set_types()]
        if _MODES not in kinds:
            return None
        sets = {
            index: read_set(file, index, path, raw, headers_only=False)
            for index, kind in enumerate(kinds)
            if kind in (_MODES, _UNITS, *NODES)
        }
    return _modes(sets, path)


def _modes(sets: dict[int, dict[str, Any]], path: Path) -> ForeignModes:
    factor = next((_length(s) for s in sets.values() if int(s["type"]) == _UNITS), 1.0)
    places = {
        int(node): np.array(xyz, dtype=float) / factor
        for found in sets.values()
        if int(found["type"]) in NODES
        for node, *xyz in zip(*(found[k] for k in ("node_nums", "x", "y", "z")), strict=False)
    }
    shapes = [(index, s) for index, s in sets.items() if int(s["type"]) == _MODES]
    if len(shapes) > _MOST_MODES:
        raise _refusal("more modes than a hanger has", 0, path)
    modes = [_mode(found, places, index, path) for index, found in shapes if _is_mode(found)]
    if not modes:
        raise BadInput(
            "its data sets of type 55 are no modes.",
            file=path,
            remedy="Export normal modes or complex eigenvalues, or the recordings themselves.",
        )
    modes.sort(key=lambda mode: mode.frequency_hz)
    return ForeignModes(str(path), str(shapes[0][1].get("id1", "")).strip()[:80], tuple(modes))


def _length(found: dict[str, Any]) -> float:
    factor = float(found.get("length") or 1.0)
    return factor if math.isfinite(factor) and factor > 0 else 1.0


def _is_mode(found: dict[str, Any]) -> bool:
    return int(found.get("analysis_type") or 0) in (_NORMAL, *_COMPLEX)


def _mode(
    found: dict[str, Any], places: dict[int, FloatArray], index: int, path: Path
) -> ForeignModalMode:
    frequency, damping = _frequency(found)
    if not (0 < frequency < 1e5):
        raise _refusal("gives no frequency of a mode", index + 1, path)
    axis, points = _shape(found, places)
    return ForeignModalMode(frequency, damping, axis, points)


def _frequency(found: dict[str, Any]) -> tuple[float, float]:
    """Return frequency in Hz and damping ratio; NaN where missing, or where it is no ratio."""
    if int(found["analysis_type"]) == _NORMAL:
        viscous = float(found.get("modal_damp_vis") or NAN)
        hysteretic = float(found.get("modal_damp_his") or NAN)
        damping = viscous if viscous > 0 else hysteretic / 2  # equal at resonance
        frequency = float(found.get("freq") or NAN)
    else:
        eigenvalue = complex(found.get("eig") or NAN)
        frequency = abs(eigenvalue) / (2 * math.pi)
        damping = -eigenvalue.real / abs(eigenvalue) if frequency > 0 else NAN
    return frequency, damping if 0 < damping < _MOST_DAMPING else NAN


def _shape(
    found: dict[str, Any], places: dict[int, FloatArray]
) -> tuple[str, tuple[ShapePoint, ...]]:
    """Return the axis of the largest motion across the hanger, and the motion at each position."""
    rows = [np.asarray(found.get(f"r{k}"), dtype=complex).ravel() for k in (1, 2, 3)]
    nodes = [int(node) for node in np.asarray(found.get("node_nums"), dtype=float).ravel()]
    if not nodes or any(len(row) != len(nodes) for row in rows):
        return "", ()
    known = [place for place, node in enumerate(nodes) if node in places]
    if not known:
        return _axis_alone(np.array(rows)), ()
    at = np.array([places[nodes[place]] for place in known])
    motion = np.array([row[known] for row in rows])
    if not (np.isfinite(at).all() and np.isfinite(motion).all()):
        return "", ()
    along = int(np.argmax(np.ptp(at, axis=0)))
    across = [axis for axis in range(3) if axis != along]
    real = _as_real(motion)
    strongest = max(across, key=lambda axis: float(np.sum(real[axis] ** 2)))
    other = next(axis for axis in across if axis != strongest)
    top = float(np.abs(real[[strongest, other]]).max())
    if not top > 0:
        return "", ()
    points = (
        ShapePoint(float(x), float(value), float(cross))
        for x, value, cross in zip(
            at[:, along], real[strongest] / top, real[other] / top, strict=True
        )
    )
    return _AXES[strongest], tuple(sorted(points, key=lambda point: point.x_m))


def _axis_alone(motion: np.ndarray) -> str:
    """Return the axis of the largest motion of a shape whose positions are unknown."""
    if not np.isfinite(motion).all() or not np.any(motion):
        return ""
    return _AXES[int(np.argmax(np.sum(_as_real(motion) ** 2, axis=1)))]


def _as_real(motion: np.ndarray) -> FloatArray:
    """Return the real part of a complex shape, rotated so that its largest component is real."""
    largest = motion.ravel()[int(np.argmax(np.abs(motion)))]
    turned: FloatArray = (motion * np.conj(largest) / (abs(largest) or 1.0)).real
    return turned


def _refusal(what: str, number: int, path: Path) -> BadInput:
    where = f"data set {number} " if number else ""
    return BadInput(f"{where}{what}.", file=path, remedy="Export or send it again.")


def axes_of(modes: Sequence[ForeignModalMode]) -> tuple[str, ...]:
    """Return the axes along which modes move, in the order of the alphabet."""
    return tuple(sorted({mode.axis for mode in modes if mode.axis}))
