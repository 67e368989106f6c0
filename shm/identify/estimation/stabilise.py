"""What every identifier does with the poles of its models: the modes among them, and the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.identify.contract import Dropped, Finding, FoundMode, Poles
from shm.identify.estimation.candidates import diagram, resolved, stable_candidates
from shm.identify.estimation.close_pairs import told_apart
from shm.identify.estimation.delays import as_simultaneous, delays_s, simultaneous
from shm.identify.estimation.poles import PoleSet, modal_assurance
from shm.identify.estimation.repeats import LEAST_HITS, find_again, proven
from shm.identify.options import IdentifyOptions

# judgement: as a pole is followed from order to order, see `candidates`; chance at three deviations
_SAME, _LIKE, _DEVIATIONS = 0.005, 0.8, 3.0
_FINAL_ORDERS = 5  # judgement: the median of five bears two strays; each costs a fit a hit


def final_orders(orders: Sequence[int]) -> list[int]:
    """The orders that estimates are taken from: up to five, spread over the upper half."""
    upper = [order for order in orders if 2 * order >= max(orders)]
    picks = np.linspace(0, len(upper) - 1, _FINAL_ORDERS).round().astype(int)
    return [upper[pick] for pick in sorted(set(picks.tolist()))]


def stabilised(
    sets: Sequence[PoleSet],
    without_each_hit: Sequence[Sequence[PoleSet]],
    seconds: float,
    options: IdentifyOptions,
) -> Finding:
    """The modes among the poles of models of rising order, `sets`.

    `without_each_hit` holds the poles at the final orders with each hit left out in turn; empty
    where there is one hit. `seconds` of ring-down decide what can be told apart.

    Every pole is in a mode's track or counted with the reason why not.
    """
    orders = final_orders([poles.order for poles in sets])
    # Where hits cannot prove a mode, the orders must: noise seldom makes a pole at nearly all.
    gaps = len(without_each_hit) >= LEAST_HITS
    candidates, unstable = stable_candidates(sets, orders, options, gaps=gaps)
    late_s = delays_s(candidates, options)
    if late_s is not None:
        sets = [simultaneous(poles, late_s) for poles in sets]
        without_each_hit = [[simultaneous(p, late_s) for p in of] for of in without_each_hit]
        candidates = [as_simultaneous(candidate, late_s) for candidate in candidates]
    single, doubles = resolved(candidates, seconds)
    final = [poles for poles in sets if poles.order in orders]
    again = find_again(single, without_each_hit)
    told, again = told_apart(single, again, (final, without_each_hit), seconds, options)
    modes, kept, doubtful, refused = proven(told, again, options)
    lost = sum(len(c.track) for c in candidates) - sum(len(c.track) for c in kept)
    followed = Dropped("poles", lost, "stable, but of a mode that was dropped")
    dropped = (*unstable, followed, *doubles, *refused)
    return Finding(modes, dropped, diagram(sets, kept, options), doubtful)


def completed(found: Finding, other: Finding) -> Finding:
    """`found` with those modes of `other` that it lacks; what was dropped is what both did."""
    added = [mode for mode in other.modes if not any(_same(mode, each) for each in found.modes)]
    modes = tuple(sorted((*found.modes, *added), key=lambda mode: mode.frequency_hz))
    dropped = tuple(
        entry for entry in found.dropped if not any(_of(entry, mode.frequency_hz) for mode in added)
    )
    doubtful = (*found.doubtful, *other.doubtful)
    return replace(found, modes=modes, dropped=dropped, doubtful=doubtful)


def _same(one: FoundMode, other: FoundMode) -> bool:
    """Whether it may be one mode; of two at one place, the one that is known stays alone."""
    sd_hz = np.hypot(one.frequency_sd_hz, other.frequency_sd_hz)
    reach_hz = max(_SAME * one.frequency_hz, _DEVIATIONS * float(np.nan_to_num(sd_hz)))
    near = abs(one.frequency_hz - other.frequency_hz) < reach_hz
    return near and modal_assurance(one.shape, other.shape) > _LIKE


def _of(entry: Dropped, frequency_hz: float) -> bool:
    """Whether that was dropped which is known as a mode of that frequency."""
    return abs(entry.frequency_hz - frequency_hz) < _SAME * frequency_hz


def nothing_moves(hits: int) -> Finding:
    """The finding where no sensor moves after any of `hits`."""
    nothing = np.empty(0)
    dropped = (Dropped("ring-downs", hits, "nothing moves in them"),)
    return Finding((), dropped, Poles(nothing, nothing, nothing, nothing.astype(bool)))
