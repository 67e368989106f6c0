"""Gives found modes their plane and order, and sets aside what is no mode of the hanger."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from shm.identify.contract import FoundMode, Tone
from shm.identify.mode_ordering.alignment import PlaneModes
from shm.identify.mode_ordering.bar_fit import described_orders
from shm.identify.mode_ordering.non_bending_modes import (
    askew_mode,
    doubts,
    explained,
    unnumbered_mode,
    without_tones,
)
from shm.identify.mode_ordering.one_axis import own_series
from shm.identify.mode_ordering.order import (
    LEAST_MARGIN,
    Expected,
    Numbering,
    assign_orders,
    basis_notes,
    plane_notes,
    support_notes,
)
from shm.identify.mode_ordering.planes import (
    blurred,
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
    NAN,
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


@dataclass(frozen=True)
class Placement:
    """The hanger's modes plane by plane, what is not one of them, and what was decided.

    `check`: how sure the numbers are, None where there are none.
    """

    modes: tuple[Mode, ...]
    set_aside: tuple[ForeignMode, ...] = ()
    notes: tuple[str, ...] = ()
    check: QualityCheck | None = None


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A found mode in the plane where it may have an order."""

    found: FoundMode
    plane: Plane
    shape: tuple[ShapePoint, ...]
    shape_sd: float
    doubt: float


_Ordered: TypeAlias = tuple[_Candidate, int, bool]
"""Candidate, order, and whether that is off the beam of the others."""

_LEAST_BY_PATTERN = 5
"""judgement: level, tension and two end springs fit four frequencies of any order."""


def placed(
    found: Sequence[FoundMode],
    points: Sequence[ResponsePoint],
    hanger: Hanger | None,
    tones: Sequence[Tone] = (),
) -> Placement:
    """The modes with plane, order and shape by position; `tones` are known to be there anyway."""
    if hanger is not None and not hanger.is_modelled:
        return _listed(*without_tones(found, tones, unordered=True), points)
    found, steady = without_tones(found, tones)
    turned_rad = principal_angle(found, points)
    known = hanger if hanger and hanger.as_hanger else None
    numbered = _numbered(found, points, known, turned_rad)
    kept = [candidate.found for candidate, *_ in numbered.ordered]
    pairs = [mode for mode in found if sum(each is mode for each in kept) == len(PLANES)]
    aside = [mode for mode in found if not any(each is mode for each in kept)]
    planes = {
        id(mode): plane if moves_in_one_plane(mode, points, turned_rad) else None
        for mode, plane in zip(found, planes_of(found, points, turned_rad), strict=True)
    }
    foreign = [_foreign(mode, planes[id(mode)], numbered, found, kept) for mode in aside]
    return Placement(
        modes=tuple(_mode(*each, pairs) for each in numbered.ordered),
        set_aside=_by_frequency([*steady, *foreign]),
        notes=(
            *plane_notes(points, turned_rad),
            *(pair_note(mode) for mode in pairs),
            *support_notes(hanger),
            *basis_notes(numbered.numbering, known, points),
            *_order_notes(numbered.ordered),
            *_irregular_notes(numbered.ordered),
        ),
        check=_check(numbered, known, found, points),
    )


def _foreign(
    mode: FoundMode,
    plane: Plane | None,
    numbered: _Numbered,
    found: Sequence[FoundMode],
    kept: Sequence[FoundMode],
) -> ForeignMode:
    """A mode without an order, as what it is."""
    if order := numbered.askew.get(id(mode)):
        return askew_mode(mode, order)
    order = numbered.unsure.get(id(mode))
    if order or not kept:
        return unnumbered_mode(mode, plane, order)
    return explained(mode, found, kept)


@dataclass(frozen=True, eq=False)
class _Numbered:
    """Modes with their orders, and of those without one, by identity, the order or why not.

    `askew` are of the other plane; `unsure` may have two orders. `margin` is the least of the
    margins of those with an order; `undecided`: see `OneAxis`.
    """

    ordered: list[_Ordered]
    numbering: Numbering
    margin: float
    askew: dict[int, int] = field(default_factory=dict)
    unsure: dict[int, int] = field(default_factory=dict)
    undecided: int = 0


def _numbered(
    found: Sequence[FoundMode],
    points: Sequence[ResponsePoint],
    known: Hanger | None,
    turned_rad: float,
) -> _Numbered:
    groups = _candidates(found, points, turned_rad)
    length_m = known.length_m if known else NAN
    expected = Expected.of(known) if known else None
    if expected and len({point.plane for point in points}) == 1:
        # Of what nobody described two series are no more likely than one: it may be no bar.
        (group,) = [each for each in groups if each] or [[]]
        return _on_one_axis(group, length_m, expected)
    planes = [_plane_modes(group, length_m) for group in groups]
    numbering = described_orders(planes, expected) if expected else assign_orders(planes)
    every = [
        (candidate, order, irregular and order == 1, margin)
        for group, orders, irregular, margins in zip(
            groups, numbering.orders, numbering.irregular, numbering.margins, strict=True
        )
        for candidate, order, margin in zip(group, orders, margins, strict=True)
        if order is not None
    ]
    return _sure(every, numbering, described=known is not None)


def _on_one_axis(group: Sequence[_Candidate], length_m: float, expected: Expected) -> _Numbered:
    """Those of the axis' own plane; a bar in the other plane may show, too."""
    axis = own_series(
        [each.found for each in group],
        lambda places: _plane_modes([group[i] for i in places], length_m),
        expected,
    )
    irregular = any(axis.numbering.irregular)
    every = [
        (candidate, order, irregular and order == 1, margin)
        for candidate, order, margin in zip(group, axis.own, axis.margins, strict=True)
        if order is not None
    ]
    askew = {id(each.found): n for each, n in zip(group, axis.askew, strict=True) if n}
    sure = _sure(every, axis.numbering, described=True)
    return replace(sure, askew=askew, undecided=axis.undecided)


def _sure(
    every: Sequence[tuple[_Candidate, int, bool, float]], numbering: Numbering, *, described: bool
) -> _Numbered:
    """Without the orders that may be others, where a description should have told them."""
    if described and numbering.basis == "counting":
        return _Numbered([], numbering, 0.0)
    few = numbering.basis == "pattern" and len(every) < _LEAST_BY_PATTERN
    least = np.inf if few else LEAST_MARGIN
    kept = [each for each in every if not described or each[-1] >= least]
    unsure = {id(c.found): n for c, n, _, margin in every if described and margin < least}
    margin = min((each[-1] for each in kept), default=0.0)
    return _Numbered([each[:3] for each in kept], numbering, margin, unsure=unsure)


def _candidates(
    found: Sequence[FoundMode], points: Sequence[ResponsePoint], turned_rad: float
) -> list[list[_Candidate]]:
    """Those of each plane; a mode that may be one of each is in both."""
    doubt = {id(mode): value for mode, value in zip(found, doubts(found), strict=True)}
    planes = planes_of(found, points, turned_rad)
    pairs = list(zip(*with_both_planes(found, planes, points, turned_rad), strict=True))
    return [
        [
            _Candidate(
                mode,
                plane,
                shape_points(mode, plane, points),
                sd_in_plane(mode, plane, points),
                float(doubt[id(mode)]),
            )
            for mode, own in pairs
            if own == plane
        ]
        for plane in PLANES
    ]


def _plane_modes(group: Sequence[_Candidate], length_m: float) -> PlaneModes:
    shapes = [candidate.shape for candidate in group]
    position = np.array([point.x_m for point in shapes[0]] if shapes else [])
    values = np.array([[point.value for point in shape] for shape in shapes])
    values = values.reshape(len(group), len(position))
    seen = np.all(np.isfinite(values), axis=0) & bool(np.isfinite(length_m))
    return PlaneModes(
        frequency_hz=np.array([candidate.found.frequency_hz for candidate in group]),
        position=position[seen] / length_m,
        shapes=values[:, seen],
        shape_sd=np.array([candidate.shape_sd for candidate in group]),
        doubt=np.array([candidate.doubt for candidate in group]),
    )


def _mode(candidate: _Candidate, order: int, irregular: bool, pairs: Sequence[FoundMode]) -> Mode:
    found = candidate.found
    if any(found is pair for pair in pairs):
        found = blurred(found)
    return Mode(
        plane=candidate.plane,
        order=order,
        frequency_hz=found.frequency_hz,
        frequency_sd_hz=found.frequency_sd_hz,
        damping_ratio=found.damping_ratio,
        damping_sd=found.damping_sd,
        shape=candidate.shape,
        acceleration_m_s2=found.acceleration_m_s2,
        irregular=irregular,
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
    """That modes are known and their orders are not."""
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
    """What is not known of the numbers, and the remedy; empty where nothing is."""
    numbering = numbered.numbering
    if numbering.basis == "counting":
        return "the modes fit no tensioned beam: they are counted", "Describe the hanger."
    if known and numbering.basis == "pattern":
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
    if numbered.askew:
        return (
            "both planes show on one axis: the series that it shows better is taken for its own",
            "Measure with a biaxial accelerometer.",
        )
    return "", ""


def _listed(
    found: Sequence[FoundMode], steady: Sequence[ForeignMode], points: Sequence[ResponsePoint]
) -> Placement:
    """The modes of a structure that no model describes, counted by frequency.

    Their plane is but the direction in which they move most.
    """
    whole = {point.plane for point in points} == set(PLANES)
    candidates = [
        _Candidate(mode, plane, shape_points(mode, plane, points), NAN, 0.0)
        for mode in found
        for plane in [_direction(mode, points) if whole else points[0].plane or PLANES[0]]
    ]
    note = "no model describes the structure: its modes are listed by frequency"
    modes = tuple(_mode(each, n, False, ()) for n, each in enumerate(candidates, 1))
    return Placement(modes, _by_frequency(steady), (note,))


def _direction(mode: FoundMode, points: Sequence[ResponsePoint]) -> Plane:
    return PLANES[int(transverse_share(mode.shape, points) < 0.5)]


def _order_notes(ordered: Sequence[_Ordered]) -> list[str]:
    notes = []
    for plane in PLANES:
        numbers = [order for candidate, order, _ in ordered if candidate.plane == plane]
        missing = sorted(set(range(1, max(numbers, default=0))) - set(numbers))
        if missing:
            listed = ", ".join(str(order) for order in missing)
            notes.append(f"{plane} order {listed} was not found; the others keep their numbers")
    return notes


def _irregular_notes(ordered: Sequence[_Ordered]) -> list[str]:
    return [
        f"{candidate.plane} order {order}, {candidate.found.frequency_hz:.2f} Hz, is well off the "
        "beam that the other orders follow, as if the hanger sagged or had lost section: no "
        "tension is inferred from it; ask `shm gap diagnose` for the cause"
        for candidate, order, irregular in ordered
        if irregular
    ]
