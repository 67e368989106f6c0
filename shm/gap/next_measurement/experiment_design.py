"""Measurements that one could still make on a hanger, as designs of one further test each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import repeat

import numpy as np

from shm.gap.hypotheses.contract import Design
from shm.models.effects import Conditions
from shm.values import PLANES, AddedMass, Hanger, IntArray

NEW_TEST = "the next test"
# Judgement, what one can do on a bridge: the other season; hits 10 dB softer and harder; a mass of
# 2 %, which moves frequencies by 2 % at most and which people carry in plates of 5 kg, at places
# that are nodes of different modes.
_WARMER_K = 20.0
_LEVELS = (0.3, 3.0)
_MASS_SHARE = 0.02
_MASS_STEP_KG = 5.0
_MASS_PLACES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.7)
# Judgement: a hammer hardly excites more modes than 16 of a hanger, another tip two more; four
# sensors draw the shapes of as many modes, as our simulated campaigns have them.
_HIGHEST_ORDER, _MORE_MODES, _ENOUGH_SENSORS = 16, 2, 4


@dataclass(frozen=True, eq=False)
class Proposal:
    """A measurement: its kind, what to do in words, and the test that it would give."""

    kind: str
    what: str
    design: Design


def measured_already(design: Design) -> tuple[str, ...]:
    """Return the kinds of measurement that the present tests hold, not to be proposed again.

    Of `other plane`, `sensors`, `temperature`, `level`, `known mass`.
    """
    survey = design.survey
    temperatures, amplitudes = survey.temperatures_c, survey.amplitudes
    there = {
        "other plane": len(survey.planes) == len(PLANES),
        "sensors": survey.biaxial and len(survey.sensor_places_m) >= _ENOUGH_SENSORS,
        "temperature": bool(temperatures) and np.ptp(temperatures) >= _WARMER_K,
        "level": bool(amplitudes) and max(amplitudes) >= _LEVELS[1] * min(amplitudes),
        "known mass": bool(survey.added_masses),
    }
    return tuple(kind for kind, done in there.items() if done)


def proposals(design: Design, hanger: Hanger) -> tuple[Proposal, ...]:
    """Return the present test once more, then all that was not yet done but new sensors."""
    every = [
        Proposal("repeat", "the same test once more", like_the_present(design)),
        *_other_plane(design),
        *_more_modes(design),
        *_other_conditions(design, hanger),
    ]
    done = measured_already(design)
    return tuple(proposal for proposal in every if proposal.kind not in done)


def with_sensors(design: Design, places_m: tuple[float, ...]) -> Proposal:
    """Return the present test once more with two-axis sensors at further places (m)."""
    modes = _modes(design)
    first = len(design.places_m)
    components = [(place, axis) for place in range(len(places_m)) for axis in range(len(PLANES))]
    rows = [(mode, first + place, axis) for mode in range(len(modes)) for place, axis in components]
    named = " and ".join(f"{x_m:g} m" for x_m in places_m)
    new = _test(design, modes, np.array(rows), places_m=places_m)
    return Proposal("sensors", f"two-axis sensors at {named}", new)


def like_the_present(design: Design, conditions: Conditions | None = None) -> Design:
    """Return a test with all modes and sensors of the present ones, under middling conditions."""
    modes = _modes(design)
    return _test(design, modes, _present_shapes(design, modes), conditions)


def lift_off(design: Design, hanger: Hanger) -> tuple[Proposal, ...]:
    """Return the present test with the tension read; none where it is known or there is none."""
    if not hanger.nominal_tension_n or np.isfinite(hanger.scatter.tension):
        return ()
    return (Proposal("lift-off", "a lift-off, the tension read", like_the_present(design)),)


def together(designs: Sequence[Design]) -> tuple[Design, list[IntArray]]:
    """Return one design of tests that are all made, and the rows of its data that each has.

    All begin with the same places; further ones are each design's own.
    """
    common = min(len(design.places_m) for design in designs)
    frequency = np.cumsum([0, *(design.frequencies for design in designs)])
    shape = np.cumsum([0, *(len(design.shape_mode) for design in designs)])
    places_m, shape_place = designs[0].places_m[:common], []
    for design in designs:
        behind = len(places_m) - common
        shape_place.append(design.shape_place + behind * (design.shape_place >= common))
        places_m += design.places_m[common:]

    def join(name: str, first: Iterable[int] = repeat(0)) -> IntArray:
        parts = zip(designs, first, strict=False)
        return np.concatenate([getattr(design, name) + number for design, number in parts])

    whole = Design(
        survey=designs[0].survey,
        conditions=tuple(each.conditions[0] for each in designs),
        places_m=places_m,
        frequency_test=join("frequency_test", range(len(designs))),
        frequency_plane=join("frequency_plane"),
        frequency_order=join("frequency_order"),
        shape_mode=join("shape_mode", frequency),
        shape_place=np.concatenate(shape_place),
        shape_component=join("shape_component"),
    )
    rows = [
        np.append(np.arange(*frequency[k : k + 2]), frequency[-1] + np.arange(*shape[k : k + 2]))
        for k in range(len(designs))
    ]
    return whole, rows


def _other_plane(design: Design) -> Iterator[Proposal]:
    modes, shapes = _modes(design), _present_shapes(design, _modes(design))
    modes = np.column_stack([1 - modes[:, 0], modes[:, 1]])
    shapes = np.column_stack([shapes[:, :2], 1 - shapes[:, 2]])
    what = f"the {PLANES[modes[0, 0]]} plane, {_orders(modes[:, 1])}"
    yield Proposal("other plane", what, _test(design, modes, shapes))


def _more_modes(design: Design) -> Iterator[Proposal]:
    highest = int(design.frequency_order.max())
    orders = np.arange(highest + 1, min(highest + _MORE_MODES, _HIGHEST_ORDER) + 1)
    if not len(orders):
        return
    planes = np.unique(design.frequency_plane)
    modes = np.array([(plane, order) for plane in planes for order in orders])
    none = np.zeros((0, 3), dtype=np.int64)
    where = " in each plane" if len(planes) > 1 else ""
    yield Proposal("more modes", f"{_orders(orders)}{where}", _test(design, modes, none))


def _other_conditions(design: Design, hanger: Hanger) -> Iterator[Proposal]:
    """Return a colder and a warmer day, softer and harder hits, known masses."""
    usual = _usual(design)
    for shift_k, word in ((-_WARMER_K, "colder"), (_WARMER_K, "warmer")):
        day = like_the_present(design, replace(usual, temperature_shift_k=shift_k))
        yield Proposal("temperature", f"a test on a day {_WARMER_K:g} K {word}", day)
    for factor, word in zip(_LEVELS, ("softer", "harder"), strict=True):
        hit = like_the_present(design, replace(usual, amplitude=factor * usual.amplitude))
        yield Proposal("level", f"a {word} hit, {factor:g} times the usual level", hit)
    wanted_kg = _MASS_SHARE * (hanger.mass_per_length_kg_m * hanger.length_m)
    step_kg = min(_MASS_STEP_KG, float(10.0 ** np.floor(np.log10(wanted_kg))))
    mass_kg = step_kg * round(wanted_kg / step_kg)
    for share in _MASS_PLACES:
        mass = AddedMass(mass_kg, round(share * hanger.length_m, 1))
        loaded = like_the_present(design, replace(usual, added_mass=mass))
        what = f"known mass of {mass.mass_kg:g} kg at {mass.x_m:g} m"
        yield Proposal("known mass", what, loaded)


def _test(
    design: Design,
    modes: IntArray,
    shapes: IntArray,
    conditions: Conditions | None = None,
    places_m: tuple[float, ...] = (),
) -> Design:
    """Return one test of `modes` (F, [plane, order]) and `shapes` (S, [mode, place, axis])."""
    return Design(
        survey=design.survey,
        conditions=(conditions or _usual(design),),
        places_m=(*design.places_m, *places_m),
        frequency_test=np.zeros(len(modes), dtype=np.int64),
        frequency_plane=modes[:, 0],
        frequency_order=modes[:, 1],
        shape_mode=shapes[:, 0],
        shape_place=shapes[:, 1],
        shape_component=shapes[:, 2],
    )


def _modes(design: Design) -> IntArray:
    """Return the distinct (plane, order) of the present tests."""
    return np.unique(np.column_stack([design.frequency_plane, design.frequency_order]), axis=0)


def _present_shapes(design: Design, modes: IntArray) -> IntArray:
    """Return the distinct (index of the mode, place, axis) of the present tests."""
    keys = np.column_stack([design.frequency_plane, design.frequency_order])[design.shape_mode]
    mode = np.argmax((keys[:, None] == modes).all(axis=2), axis=1) if len(keys) else keys[:, 0]
    return np.unique(
        np.column_stack([mode, design.shape_place, design.shape_component]), axis=0
    ).astype(np.int64)


def _usual(design: Design) -> Conditions:
    level = np.median([each.amplitude for each in design.conditions])
    return Conditions(test=NEW_TEST, amplitude=float(level))


def _orders(orders: IntArray) -> str:
    named = np.unique(orders)
    if len(named) == 1:
        return f"mode {named[0]}"
    return f"modes {named[0]} {'and' if len(named) == 2 else 'to'} {named[-1]}"
