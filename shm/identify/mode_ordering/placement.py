"""Gives found modes their plane and order, and says what is no mode of the hanger and why.

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
    PlaneModes,
    fit_bar,
    number_modes,
)
from shm.identify.mode_ordering.one_axis import COST_OF_RATIO, AxisOrders, tell_planes
from shm.identify.mode_ordering.planes import (
    blur,
    moves_in_one_plane,
    pair_note,
    planes_of,
    principal_angle,
    sd_in_plane,
    shape_points,
    transverse_share,
    with_both_planes,
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
    numbered = _number(found, points, known, turned_rad)
    if known and look:
        more = _in_gaps(numbered.ordered, look, known, found, points)
        numbered = replace(numbered, ordered=sorted(
            [*numbered.ordered, *more], key=lambda each: (PLANES.index(each.plane), each.order)
        ))  # fmt: skip
    ordered = [each.found for each in numbered.ordered]
    pairs = [mode for mode in found if sum(each is mode for each in ordered) == len(PLANES)]
    unordered = [mode for mode in found if not any(each is mode for each in ordered)]
    planes = {
        id(mode): plane if moves_in_one_plane(mode, points, turned_rad) else None
        for mode, plane in zip(found, planes_of(found, points, turned_rad), strict=True)
    }
    foreign = [_foreign(mode, planes[id(mode)], numbered, found, ordered) for mode in unordered]
    return Placement(
        modes=tuple(_mode(each, pairs) for each in numbered.ordered),
        foreign_modes=_by_frequency([*steady, *foreign]),
        notes=tuple(_notes(numbered, hanger, points, turned_rad, pairs)),
        check=_check(numbered, known, found, points),
    )


def _number(
    found: Sequence[FoundMode],
    points: Sequence[ResponsePoint],
    known: Hanger | None,
    turned_rad: float,
) -> _Numbered:
    """Return the modes with the orders that are sure enough."""
    planes = planes_of(found, points, turned_rad)
    pairs = list(zip(*with_both_planes(found, planes, points, turned_rad), strict=True))
    groups = [
        [_Candidate(m, p, shape_points(m, p, points)) for m, p in pairs if p == plane]
        for plane in PLANES
    ]
    one_axis = known is not None and len({point.plane for point in points}) == 1
    if one_axis:
        groups = [each for each in groups if each] or [[]]
    weight = COST_OF_RATIO if one_axis else 1.0
    inputs = [_plane_modes(group, points, known, weight) for group in groups]
    numbering = number_modes(inputs, known)
    orders, axis_orders = numbering.orders, None
    if known and one_axis and numbering.basis != "counting":
        axis_orders = tell_planes([each.found for each in groups[0]], orders[0], inputs[0], known)
        orders = (axis_orders.in_axis,)
    every = [
        replace(each, order=order, irregular=irregular and order == 1, margin=margin)
        for group, plane_orders, irregular, margins in zip(
            groups, orders, numbering.irregular, numbering.margins, strict=True
        )
        for each, order, margin in zip(group, plane_orders, margins, strict=True)
    ]
    return _sure(every, numbering.basis, axis_orders, groups[0], described=known is not None)


def _sure(
    every: Sequence[_Candidate],
    basis: Basis,
    axis_orders: AxisOrders | None,
    group: Sequence[_Candidate],
    *,
    described: bool,
) -> _Numbered:
    """Return them without the orders that may be others, where a description should tell them."""
    if described and basis == "counting":
        return _Numbered([], basis)
    ordered = [each for each in every if each.order]
    few = basis == "pattern" and len(ordered) < _LEAST_BY_PATTERN
    least = np.inf if few else LEAST_MARGIN
    accepted = [each for each in ordered if not described or each.margin >= least]
    unsure = {id(c.found): c.order for c in ordered if described and c.margin < least}
    if axis_orders is None:
        return _Numbered(accepted, basis, unsure=unsure)
    cross_axis = {id(c.found): n for c, n in zip(group, axis_orders.cross_axis, strict=True) if n}
    return _Numbered(accepted, basis, cross_axis, unsure, axis_orders.undecided)


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


def _in_gaps(
    sure: Sequence[_Candidate],
    look: Look,
    hanger: Hanger,
    found: Sequence[FoundMode],
    points: Sequence[ResponsePoint],
) -> list[_Candidate]:
    """Return what a closer look shows at the orders that the bar of the sure modes has, too."""
    planes = [plane for plane in PLANES if any(each.plane == plane for each in sure)]
    if len(sure) < LEAST_MODES:
        return []
    groups = [[each for each in sure if each.plane == plane] for plane in planes]
    highest = max(each.order for each in sure)
    orders = tuple(tuple(each.order for each in group) for group in groups)
    if all(len(group) == highest for group in orders):
        return []
    frequency_hz = [np.array([each.found.frequency_hz for each in group]) for group in groups]
    bar = fit_bar(frequency_hz, orders, hanger)
    gaps = {
        (plane, order): hz
        for number, plane in enumerate(planes)
        for order, hz in enumerate(bar.frequencies_hz(number, highest).tolist(), 1)
        if order not in orders[number]
    }
    modes, doubtful = look(list(gaps.values()))
    seen = [*modes, *doubtful] if bar.is_plain else list(modes)
    places = planes_of(seen, points, principal_angle(found, points))
    reach = _NEAR if bar.is_plain else _FAR
    taken: list[_Candidate] = []
    for (plane, order), hz in gaps.items():
        near = [
            mode
            for mode, moves_in in zip(seen, places, strict=True)
            if moves_in == plane
            and abs(mode.frequency_hz - hz) < reach * hz
            and mode.frequency_sd_hz < _NEAR * hz
            and not any(_is_same(mode, each) for each in [*sure, *taken] if each.plane == plane)
        ]
        if near:
            best = min(near, key=lambda mode: abs(mode.frequency_hz - hz))
            shape = shape_points(best, plane, points)
            taken.append(_Candidate(best, plane, shape, order, margin=LEAST_MARGIN))
    return taken


def _is_same(mode: FoundMode, other: _Candidate) -> bool:
    return abs(mode.frequency_hz / other.found.frequency_hz - 1) < _NEAR


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


def _mode(candidate: _Candidate, pairs: Sequence[FoundMode]) -> Mode:
    found = candidate.found
    if any(found is pair for pair in pairs):
        found = blur(found)
    return Mode(
        plane=candidate.plane,
        order=candidate.order,
        frequency_hz=found.frequency_hz,
        frequency_sd_hz=found.frequency_sd_hz,
        damping_ratio=found.damping_ratio,
        damping_sd=found.damping_sd,
        shape=candidate.shape,
        acceleration_m_s2=found.acceleration_m_s2,
        irregular=candidate.irregular,
        amplitude_slope=found.amplitude_slope,
        amplitude_slope_sd=found.amplitude_slope_sd,
    )


def _by_frequency(modes: Sequence[ForeignMode]) -> tuple[ForeignMode, ...]:
    return tuple(sorted(modes, key=lambda mode: mode.frequency_hz))


STATE_PLANES = (
    "State the plane of each channel: `shm import FILE` asks for it and keeps it for all files of "
    "the logger, or write `plane` into the file's header or its sidecar."
)
_MORE = "Measure more of the lowest modes: hit with a softer tip, and away from the ends."


def _check(
    numbered: _Numbered,
    known: Hanger | None,
    found: Sequence[FoundMode],
    points: Sequence[ResponsePoint],
) -> QualityCheck | None:
    """Judge how sure the orders are; None where there is no mode."""
    if found and not any(point.plane for point in points):
        return _of_no_planes(numbered)
    if not numbered.ordered:
        return _of_no_order(numbered) if found else None
    value = float(min(numbered.margin, 100.0))  # technical: of a figure that can be read
    doubt, remedy = _doubt_of_numbers(numbered, known)
    if doubt:
        return QualityCheck(NUMBERING, "warning", value, LEAST_MARGIN, "", doubt, remedy)
    return QualityCheck(
        NUMBERING, "good", value, LEAST_MARGIN, "", "no other numbering fits as well"
    )


def _of_no_planes(numbered: _Numbered) -> QualityCheck:
    """Blame the missing planes before the test: modes of both planes are taken for one series."""
    verdict: Verdict = "warning" if numbered.ordered else "refused"
    found = "no channel states its plane: modes of both planes may be mixed"
    if not numbered.ordered:
        found = f"the orders of the modes are not known: {found}"
    return QualityCheck(NUMBERING, verdict, 0.0, LEAST_MARGIN, "", found, STATE_PLANES)


def _of_no_order(numbered: _Numbered) -> QualityCheck:
    """Return the check for modes that are known while their orders are not."""
    found = "the modes fit neither the hanger's description nor any tensioned bar"
    if numbered.unsure:
        found = f"the lowest may be order {min(numbered.unsure.values())}, or another"
    return QualityCheck(
        NUMBERING, "refused", 0.0, LEAST_MARGIN, "",
        f"the orders of the modes are not known: {found}",
        f"{_MORE} Or correct length, section and nominal tension in the description; or give the "
        "modes with the orders that you know for right as a modal-tests document.",
    )  # fmt: skip


def _doubt_of_numbers(numbered: _Numbered, known: Hanger | None) -> tuple[str, str]:
    """Return what is uncertain about the numbers, and the remedy; empty where nothing is."""
    if numbered.basis == "counting":
        return "the modes fit no tensioned beam: they are counted", "Describe the hanger."
    if known and numbered.basis == "pattern":
        return (
            "the modes do not fit the hanger's description: their own pattern alone numbers them",
            "Correct length, section and nominal tension in the description, or the hanger.",
        )
    if numbered.margin < LEAST_MARGIN:
        return (
            "other numbers fit these modes nearly as well",
            _MORE if known else "Describe the hanger.",
        )
    if numbered.unsure:
        return (
            f"of {len(numbered.unsure)} modes the orders are not known: two fit nearly as well",
            _MORE,
        )
    if numbered.undecided:
        return (
            f"both planes show on one axis, and of {numbered.undecided} orders nothing tells "
            "which mode is whose",
            "Measure with a biaxial accelerometer.",
        )
    if numbered.cross_axis:
        return (
            "both planes show on one axis: the series that it shows better is taken for its own",
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
        modes.append(_mode(_Candidate(mode, plane, shape_points(mode, plane, points), order), ()))
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
    degrees = abs(math.degrees(turned_rad))
    known = hanger is not None and hanger.as_hanger
    if not any(point.plane for point in points):
        notes = ["no channel states its plane: all modes are taken as transverse"]
    elif degrees >= _NOTED_DEGREES:
        notes = [
            f"the hanger's planes are turned by {degrees:.0f} degrees from the sensors' axes: each "
            "mode has the name of the nearer plane"
        ]
    else:
        notes = []
    notes += [pair_note(mode) for mode in pairs]
    if hanger is not None and not known:
        notes.append(
            "the hanger is not clamped at both ends and in tension: its description does not help "
            "to number the modes"
        )
    if numbered.basis == "counting":
        notes.append("the modes fit no tensioned beam: they are counted, so orders may be off")
    elif known and numbered.basis == "pattern":
        notes.append(
            "the modes do not fit the hanger's description: they are numbered by the pattern of "
            "their frequencies alone"
        )
    elif known and not any(np.isfinite(point.x_m) for point in points):
        notes.append("no sensor states its position: shapes do not help to number the modes")
    return [*notes, *_order_notes(numbered.ordered)]


def _order_notes(ordered: Sequence[_Candidate]) -> list[str]:
    notes = []
    for plane in PLANES:
        numbers = [each.order for each in ordered if each.plane == plane]
        missing = sorted(set(range(1, max(numbers, default=0))) - set(numbers))
        if missing:
            listed = ", ".join(str(order) for order in missing)
            notes.append(f"{plane} order {listed} was not found; the others keep their numbers")
    return notes + [
        f"{each.plane} order {each.order}, {each.found.frequency_hz:.2f} Hz, is well off the "
        "beam that the other orders follow, as if the hanger sagged or had lost section: no "
        "tension is inferred from it; ask `shm gap diagnose` for the cause"
        for each in ordered
        if each.irregular
    ]
