"""The name of an adopted class, from what its owner says and what the diagnosis found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.errors import BadInput, UsageError
from shm.models.adopted import (
    AdoptedEffect,
    AdoptedName,
    bounds_of,
    in_log,
    missed_by_one_test,
    own_name,
    places_of,
    variant_of,
)
from shm.models.effects import EFFECTS, Parameter, Variant, parameters_of
from shm.store import StoredDiagnosis, StoredTest
from shm.values import Cause, EffectEstimate, Hanger

_FIRST_BASELINE = "beam1"
_SHARE = 0.9  # the interval of every report


def adopted_name(
    effects: Sequence[str],
    at: Sequence[str],
    baseline: str,
    hanger: Hanger,
    stored: StoredDiagnosis | None,
    tests: Sequence[StoredTest],
) -> AdoptedName:
    """The class of `baseline` with `effects`, each acting `at`, or where the diagnosis has it.

    `baseline` is that of the diagnosis where it is empty. The temperature that an effect follows
    counts from the mean of the diagnosed tests. Raises UsageError where it remains unknown where an
    effect acts, BadInput where one needs figures that no diagnosis gives.
    """
    cause = _cause(effects, stored)
    places = _places(effects, at, cause, hanger)
    diagnosed = [t for t in tests if stored is None or t.test.id in stored.diagnosis.tests]
    reference_c = _mean_temperature_c(diagnosed)
    parts = [
        _part(effect, place, reference_c, hanger, cause)
        for effect, place in zip(effects, places, strict=True)
    ]
    known = baseline or (stored.diagnosis.baseline if stored else _FIRST_BASELINE)
    return AdoptedName(known, tuple(parts))


def _cause(effects: Sequence[str], stored: StoredDiagnosis | None) -> Cause | None:
    """The cause of the diagnosis that holds just these effects."""
    causes = stored.diagnosis.causes if stored else ()
    return next((cause for cause in causes if sorted(cause.effects) == sorted(effects)), None)


def _places(
    effects: Sequence[str], at: Sequence[str], cause: Cause | None, hanger: Hanger
) -> list[str]:
    """The key of where each effect acts: as said, else the likeliest, else the only one."""
    if at:
        if len(at) != len(effects):
            raise UsageError(
                f"{len(effects)} effect(s) and {len(at)} place(s).", remedy="Give --at for each."
            )
        return [Variant(each).key for each in at]
    if cause is not None:
        return [Variant(_place_in(cause, effect)).key for effect in effects]
    return [_only_place(effect, hanger) for effect in effects]


def _only_place(effect: str, hanger: Hanger) -> str:
    keys = places_of(effect, hanger)
    if len(keys) > 1:
        raise UsageError(
            f"where does {effect} act? No diagnosis of hanger {hanger.id} tells.",
            remedy=f"Give --at, one of {', '.join(keys)}; or diagnose: `shm gap diagnose --hanger "
            f"{hanger.id}`.",
        )
    return keys[0]


def _mean_temperature_c(tests: Sequence[StoredTest]) -> float:
    known = [t.test.temperature_c for t in tests if math.isfinite(t.test.temperature_c)]
    return float(np.mean(known)) if known else math.nan


def _part(
    effect: str, key: str, reference_c: float, hanger: Hanger, cause: Cause | None
) -> AdoptedEffect:
    """One effect, with what a single test cannot say about it: reference and ranges.

    Where and how it acts stays as the diagnosis found it; its size is free to follow the hanger,
    unless a single test cannot show it.
    """
    keys = places_of(effect, hanger)
    follows = "temperature" in EFFECTS[effect].follows
    if follows and math.isnan(reference_c):
        raise BadInput(
            f"{effect} follows the temperature, which no test of hanger {hanger.id} has.",
            remedy="Give temperature_c with the tests.",
        )
    part = AdoptedEffect(effect, key, reference_c if follows else math.nan)
    if key not in keys:
        return part
    told = cause is not None and Variant(_place_in(cause, effect)).key == key
    missed = missed_by_one_test(effect, hanger)
    if missed and not told:
        raise BadInput(
            f"a single test cannot show {effect}, so that its size must come from a diagnosis of "
            f"many. {missed}",
            remedy=f"Diagnose first: `shm gap diagnose --hanger {hanger.id}`.",
        )
    found = _estimates(effect, cause) if cause is not None and told else {}
    ranges = {
        own_name(each): _range(each, found[each.name])
        for each in parameters_of(effect, hanger, variant_of(part, hanger))
        if each.name in found and (missed or math.isnan(each.zero))
    }
    return replace(part, ranges=ranges)


def _place_in(cause: Cause, effect: str) -> str:
    return dict(zip(cause.effects, cause.places, strict=True))[effect]


def _estimates(effect: str, cause: Cause) -> dict[str, EffectEstimate]:
    """What the diagnosis found; of a pair, names that both have stand behind their effect's."""
    return {each.name.removeprefix(f"{effect}."): each for each in cause.parameters}


def _range(parameter: Parameter, found: EffectEstimate) -> tuple[float, float]:
    """The range whose middle 90 % is the diagnosis's 90 % interval, within the catalogue's."""
    low, high = (math.log10(q) if in_log(parameter) else q for q in (found.q05, found.q95))
    middle, half = (low + high) / 2, (high - low) / 2 / _SHARE
    least, most = bounds_of(parameter)
    return max(middle - half, least), min(middle + half, most)
