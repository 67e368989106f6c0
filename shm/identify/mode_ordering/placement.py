"""Give found modes their plane and order, and say what is no mode of the hanger and why.

Where the numbered modes are a bar's, it says where the missing orders are, and a closer look may
show them: a weak mode, or one beside another, changes by more from hit to hit than is asked of a
mode that nothing else speaks for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from shm.identify.contract import FoundMode, Tone
from shm.identify.mode_ordering.foreign import (
    cross_axis_mode,
    explain_foreign,
    unnumbered_mode,
    without_tones,
)
from shm.identify.mode_ordering.numbering import (
    LEAST_MARGIN,
    LEAST_MODES,
    PLAIN_BAR,
    Basis,
    FittedBar,
    PlaneModes,
    fit_bar,
    number_modes,
)
from shm.identify.mode_ordering.one_axis import COST_OF_RATIO, tell_planes
from shm.identify.mode_ordering.planes import (
    blur,
    is_unresolved_pair,
    moves_in_one_plane,
    planes_of,
    principal_angle,
    sd_in_plane,
    shape_points,
    transverse_share,
)
from shm.values import (
    PLANES,
    ForeignMode,
    Hanger,
    Mode,
    Plane,
    QualityCheck,
    ResponsePoint,
    ShapePoint,
    Verdict,
)
from shm.values.modes import NUMBERING

_LEAST_BY_PATTERN = 5
"""judgement: level, tension and two end springs fit four frequencies of any order."""
_NEAR, _FAR = 3 * PLAIN_BAR, 0.03
"""Of a frequency: how far from a plain bar's, and from that of one with plates or brackets, a mode
of a missing order may lie. In 125 tests of tests/worlds/recordings.py (seeds 9400, 9401, 9500 to
9502) 1643 of 1960 identifiable modes are found without a closer look, 1727 with it; 4 false ones
with and without."""
_NOTED_DEGREES = 5.0  # judgement: a sensor clamped on by eye; it sees 0.8 % of the other plane
STATE_PLANES = (
    "State the plane of each channel: `shm import FILE` asks for it and keeps it for all files of "
    "the logger, or write `plane` into the file's header or its sidecar."
)
_MORE = "Measure more of the lowest modes: hit with a softer tip, and away from the ends."
_CORRECT = "Correct length, section and nominal tension in the description, or the hanger"
_OTHER_BASIS = {
    "counting": "the modes fit no tensioned beam: they are counted, so orders may be off",
    "pattern": "the modes do not fit the hanger's description: their pattern alone numbers them",
}

Look: TypeAlias = Callable[[Sequence[float]], tuple[Sequence[FoundMode], Sequence[FoundMode]]]
"""What a closer look shows at the given frequencies in Hz: modes, and modes in doubt."""


@dataclass(frozen=True)
class Placement:
    """The hanger's modes plane by plane, what is not one of them, and what was decided.

    `check`: how sure the numbers are, None where there are none.
    """

    modes: tuple[Mode, ...]
    foreign_modes: tuple[ForeignMode, ...] = ()
    notes: tuple[str, ...] = ()
    check: QualityCheck | None = None


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A found mode in the plane where it may have an order, and that order, 0 for none."""

    found: FoundMode
    plane: Plane
    shape: tuple[ShapePoint, ...]
    order: int = 0
    irregular: bool = False
    margin: float = 0.0

    def as_mode(self, *, is_pair: bool) -> Mode:
        """Return the mode of the hanger."""
        found = blur(self.found) if is_pair else self.found
        return Mode(
            plane=self.plane,
            order=self.order,
            frequency_hz=found.frequency_hz,
            frequency_sd_hz=found.frequency_sd_hz,
            damping_ratio=found.damping_ratio,
            damping_sd=found.damping_sd,
            shape=self.shape,
            acceleration_m_s2=found.acceleration_m_s2,
            irregular=self.irregular,
            amplitude_slope=found.amplitude_slope,
            amplitude_slope_sd=found.amplitude_slope_sd,
        )


@dataclass(frozen=True, eq=False)
class _Numbered:
    """Hold candidates with their orders, and modes without one by identity.

    `cross_axis` are of the other plane; `unsure` may have two orders; `undecided` counts the orders
    of one axis with two modes that cannot be assigned.
    """

    ordered: list[_Candidate]
    basis: Basis
    cross_axis: dict[int, int] = field(default_factory=dict)
    unsure: dict[int, int] = field(default_factory=dict)
    undecided: int = 0

    @property
    def margin(self) -> float:
        """Return the least margin of those with an order."""
        return min((each.margin for each in self.ordered), default=0.0)


def place_modes(
    found: Sequence[FoundMode],
    points: Sequence[ResponsePoint],
    hanger: Hanger | None,
    tones: Sequence[Tone] = (),
    look: Look | None = None,
) -> Placement:
    """Return the modes with plane, order and shape by position; `tones` are known to be there."""
    if hanger is not None and not hanger.is_modelled:
        return _listed(*without_tones(found, tones, unordered=True), points)
    found, steady = without_tones(found, tones)
    turned_rad = principal_angle(found, points)
    known = hanger if hanger and hanger.as_hanger else None
    planes = planes_of(found, points, turned_rad)
    pairs = [mode for mode in found if is_unresolved_pair(mode, found, points, turned_rad)]
    candidates = [
        _Candidate(mode, each, shape_points(mode, each, points))
        for mode, plane in zip(found, planes, strict=True)
        for each in (PLANES if mode in pairs else (plane,))
    ]
    numbered = _number(candidates, points, known)
    if known and pairs:
        numbered = replace(numbered, ordered=_without_askew(numbered.ordered, pairs, known))
    if known and look:
        more = _in_gaps(numbered.ordered, look, known, points, turned_rad)
        every = [*numbered.ordered, *more]
        numbered = replace(numbered, ordered=sorted(every, key=_plane_and_order))
    ordered = [each.found for each in numbered.ordered]
    pairs = [mode for mode in pairs if ordered.count(mode) == len(PLANES)]
    foreign = [
        _foreign(mode, plane if moves_in_one_plane(mode, points, turned_rad) else None,
                 numbered, found, ordered)
        for mode, plane in zip(found, planes, strict=True)
        if mode not in ordered
    ]  # fmt: skip
    return Placement(
        modes=tuple(each.as_mode(is_pair=each.found in pairs) for each in numbered.ordered),
        foreign_modes=_by_frequency([*steady, *foreign]),
        notes=tuple(_notes(numbered, hanger, points, turned_rad, pairs)),
        check=_check(numbered, known, points) if found else None,
    )


def _plane_and_order(candidate: _Candidate) -> tuple[int, int]:
    return PLANES.index(candidate.plane), candidate.order


def _number(
    candidates: Sequence[_Candidate], points: Sequence[ResponsePoint], known: Hanger | None
) -> _Numbered:
    """Return the modes with the orders that are sure enough."""
    groups = [[each for each in candidates if each.plane == plane] for plane in PLANES]
    one_axis = known is not None and len({point.plane for point in points}) == 1
    if one_axis:
        groups = [each for each in groups if each] or [[]]
    weight = COST_OF_RATIO if one_axis else 1.0
    planes = [_plane_modes(group, points, known, weight) for group in groups]
    numbering = number_modes(planes, known)
    if known and numbering.basis == "counting":
        return _Numbered([], "counting")
    orders, cross_axis, undecided = numbering.orders, {}, 0
    if known and one_axis:
        axis = tell_planes(orders[0], planes[0], known)
        orders, undecided = (axis.in_axis,), axis.undecided
        cross_axis = {
            id(c.found): order for c, order in zip(groups[0], axis.cross_axis, strict=True) if order
        }
    ordered = [
        replace(each, order=order, irregular=irregular and order == 1, margin=margin)
        for group, of_plane, irregular, margins in zip(
            groups, orders, numbering.irregular, numbering.margins, strict=True
        )
        for each, order, margin in zip(group, of_plane, margins, strict=True)
        if order
    ]
    least = LEAST_MARGIN if known else -np.inf
    too_few = known and numbering.basis == "pattern" and len(ordered) < _LEAST_BY_PATTERN
    accepted = [] if too_few else [each for each in ordered if each.margin >= least]
    unsure = {id(each.found): each.order for each in ordered if each not in accepted}
    return _Numbered(accepted, numbering.basis, cross_axis, unsure, undecided)


def _plane_modes(
    group: Sequence[_Candidate],
    points: Sequence[ResponsePoint],
    known: Hanger | None,
    weight: float,
) -> PlaneModes:
    """Return what numbering knows of a plane; shapes only where the length is known."""
    shapes = [candidate.shape for candidate in group]
    position = np.array([point.x_m for point in shapes[0]] if shapes else [])
    values = np.array([[point.value for point in shape] for shape in shapes])
    values = values.reshape(len(group), len(position))
    seen = np.all(np.isfinite(values), axis=0) & (known is not None)
    strength = np.array([each.found.acceleration_m_s2 for each in group])
    usable = np.isfinite(strength) & (strength > 0)
    return PlaneModes(
        frequency_hz=np.array([each.found.frequency_hz for each in group]),
        strength=weight * np.log(np.where(usable, strength, 1.0)),
        position=position[seen] / (known.length_m if known else 1.0),
        shapes=values[:, seen],
        shape_sd=np.array([sd_in_plane(each.found, each.plane, points) for each in group]),
    )


def _bar_of(sure: Sequence[_Candidate], planes: Sequence[Plane], hanger: Hanger) -> FittedBar:
    """Return the bar of modes with orders."""
    groups = [[each for each in sure if each.plane == plane] for plane in planes]
    frequency_hz = [np.array([each.found.frequency_hz for each in group]) for group in groups]
    return fit_bar(frequency_hz, tuple(tuple(each.order for each in g) for g in groups), hanger)


def _without_askew(
    sure: Sequence[_Candidate], pairs: Sequence[FoundMode], hanger: Hanger
) -> list[_Candidate]:
    """Return the modes, but of a pair only the one whose place the others' bar has there.

    Where the bar has the other plane's mode farther off than half a bandwidth, nothing merged: a
    turned sensor, or one of wrong gain, shows one plane's mode askew.
    """
    others = [each for each in sure if each.found not in pairs]
    if len(others) < LEAST_MODES or {each.plane for each in others} != set(PLANES):
        return list(sure)
    bar = _bar_of(others, PLANES, hanger)
    if not bar.is_plain:
        return list(sure)

    def off(each: _Candidate) -> float:
        own_hz = bar.frequencies_hz(PLANES.index(each.plane), each.order)[-1]
        return abs(float(own_hz) / each.found.frequency_hz - 1)

    return [
        each
        for each in sure
        if each in others
        or off(each) < _NEAR + each.found.damping_ratio
        or off(each) == min(off(copy) for copy in sure if copy.found is each.found)
    ]


def _in_gaps(
    sure: Sequence[_Candidate],
    look: Look,
    hanger: Hanger,
    points: Sequence[ResponsePoint],
    turned_rad: float,
) -> list[_Candidate]:
    """Return what a closer look shows at the orders that the bar of the sure modes has, too."""
    known = {(each.plane, each.order) for each in sure}
    planes = sorted({each.plane for each in sure}, key=PLANES.index)
    highest = max((each.order for each in sure), default=0)
    if len(sure) < LEAST_MODES or len(known) == len(planes) * highest:
        return []
    bar = _bar_of(sure, planes, hanger)
    gaps = [
        (plane, order, hz)
        for number, plane in enumerate(planes)
        for order, hz in enumerate(bar.frequencies_hz(number, highest).tolist(), 1)
        if (plane, order) not in known
    ]
    modes, doubtful = look([hz for *_, hz in gaps])
    seen = [*modes, *doubtful] if bar.is_plain else list(modes)
    places = planes_of(seen, points, turned_rad)
    reach = _NEAR if bar.is_plain else _FAR
    taken: list[_Candidate] = []
    for plane, order, hz in gaps:
        known_hz = [each.found.frequency_hz for each in [*sure, *taken] if each.plane == plane]
        near = [
            mode
            for mode, moves_in in zip(seen, places, strict=True)
            if moves_in == plane
            and abs(mode.frequency_hz - hz) < reach * hz
            and mode.frequency_sd_hz < _NEAR * hz
            and all(abs(mode.frequency_hz / other_hz - 1) >= _NEAR for other_hz in known_hz)
        ]
        if near:
            best = min(near, key=lambda mode: abs(mode.frequency_hz - hz))
            shape = shape_points(best, plane, points)
            taken.append(_Candidate(best, plane, shape, order, margin=LEAST_MARGIN))
    return taken


def _foreign(
    mode: FoundMode,
    plane: Plane | None,
    numbered: _Numbered,
    found: Sequence[FoundMode],
    hanger_modes: Sequence[FoundMode],
) -> ForeignMode:
    """Return a mode without an order, as what it is."""
    if order := numbered.cross_axis.get(id(mode)):
        return cross_axis_mode(mode, order)
    order = numbered.unsure.get(id(mode))
    if order or not hanger_modes:
        return unnumbered_mode(mode, plane, order)
    return explain_foreign(mode, found, hanger_modes)


def _by_frequency(modes: Sequence[ForeignMode]) -> tuple[ForeignMode, ...]:
    return tuple(sorted(modes, key=lambda mode: mode.frequency_hz))


def _check(
    numbered: _Numbered, known: Hanger | None, points: Sequence[ResponsePoint]
) -> QualityCheck:
    """Judge how sure the orders are."""
    value = float(min(numbered.margin, 100.0))  # technical: of a figure that can be read
    verdict: Verdict = "warning" if numbered.ordered else "refused"
    if not any(point.plane for point in points):
        # Blamed before the test itself: modes of both planes are taken for one series.
        value, remedy = 0.0, STATE_PLANES
        doubt = "no channel states its plane: modes of both planes may be mixed"
    elif not numbered.ordered:
        doubt = "the modes fit neither the hanger's description nor any tensioned bar"
        if numbered.unsure:
            doubt = f"the lowest may be order {min(numbered.unsure.values())}, or another"
        remedy = (
            f"{_MORE} {_CORRECT}; or give the modes with the orders that you know for right as a "
            "modal-tests document."
        )
    else:
        doubt, remedy = _doubt_of_numbers(numbered, known)
    if not numbered.ordered:
        doubt = f"the orders of the modes are not known: {doubt}"
    if not doubt:
        verdict, doubt = "good", "no other numbering fits as well"
    return QualityCheck(NUMBERING, verdict, value, LEAST_MARGIN, "", doubt, remedy)


def _doubt_of_numbers(numbered: _Numbered, known: Hanger | None) -> tuple[str, str]:
    """Return what is uncertain about the numbers, and the remedy; empty where nothing is."""
    if numbered.basis == "counting":
        return _OTHER_BASIS["counting"], "Describe the hanger."
    if known and numbered.basis == "pattern":
        return _OTHER_BASIS["pattern"], f"{_CORRECT}."
    if numbered.margin < LEAST_MARGIN:
        remedy = _MORE if known else "Describe the hanger."
        return "other numbers fit these modes nearly as well", remedy
    if numbered.unsure:
        count = len(numbered.unsure)
        return f"of {count} modes the orders are not known: two fit nearly as well", _MORE
    if numbered.undecided or numbered.cross_axis:
        more = "the series that it shows better is taken for its own"
        if numbered.undecided:
            more = f"of {numbered.undecided} orders nothing tells which mode is whose"
        return (
            f"both planes show on one axis: {more}",
            "Measure with a biaxial accelerometer.",
        )
    return "", ""


def _listed(
    found: Sequence[FoundMode], steady: Sequence[ForeignMode], points: Sequence[ResponsePoint]
) -> Placement:
    """Return the modes of a structure that no model describes, counted by frequency.

    Their plane is but the direction in which they move most.
    """
    both = {point.plane for point in points} == set(PLANES)
    modes = []
    for order, mode in enumerate(found, 1):
        plane = points[0].plane or PLANES[0]
        if both:
            plane = PLANES[int(transverse_share(mode.shape, points) < 0.5)]
        candidate = _Candidate(mode, plane, shape_points(mode, plane, points), order)
        modes.append(candidate.as_mode(is_pair=False))
    note = "no model describes the structure: its modes are listed by frequency"
    return Placement(tuple(modes), _by_frequency(steady), (note,))


def _notes(
    numbered: _Numbered,
    hanger: Hanger | None,
    points: Sequence[ResponsePoint],
    turned_rad: float,
    pairs: Sequence[FoundMode],
) -> list[str]:
    """Return what a reader should know of how planes and orders were decided."""
    notes = []
    degrees = abs(math.degrees(turned_rad))
    known = hanger is not None and hanger.as_hanger
    if not any(point.plane for point in points):
        notes.append("no channel states its plane: all modes are taken as transverse")
    elif degrees >= _NOTED_DEGREES:
        notes.append(
            f"the hanger's planes are turned by {degrees:.0f} degrees from the sensors' axes: each "
            "mode has the name of the nearer plane"
        )
    notes += [
        f"the mode at {mode.frequency_hz:.2f} Hz moves in both planes: it stands for one of each, "
        "uncertain by a tenth of its bandwidth"
        for mode in pairs
    ]
    if hanger is not None and not known:
        notes.append(
            "the hanger is not clamped at both ends and in tension: its description does not help "
            "to number the modes"
        )
    if numbered.basis == "counting" or (known and numbered.basis == "pattern"):
        notes.append(_OTHER_BASIS[numbered.basis])
    elif known and not any(np.isfinite(point.x_m) for point in points):
        notes.append("no sensor states its position: shapes do not help to number the modes")
    for plane in PLANES:
        numbers = [each.order for each in numbered.ordered if each.plane == plane]
        missing = sorted(set(range(1, max(numbers, default=0))) - set(numbers))
        if missing:
            listed = ", ".join(str(order) for order in missing)
            notes.append(f"{plane} order {listed} was not found; the others keep their numbers")
    return notes + [
        f"{each.plane} order {each.order}, {each.found.frequency_hz:.2f} Hz, is well off the "
        "beam that the other orders follow, as if the hanger sagged or had lost section: no "
        "tension is inferred from it; ask `shm gap diagnose` for the cause"
        for each in numbered.ordered
        if each.irregular
    ]
