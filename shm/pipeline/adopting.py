"""Making a baseline with effects the model class of a hanger, and watching what became of its gap.

The tests that made the hanger's baseline are updated anew in the adopted class: from then on that
posterior is the baseline, so that what has moved since the first tests still shows. Nothing is
computed twice and nothing is lost: the former posteriors compete beside it in the selection on
record, and dropping the adoption puts them in force again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from shm.errors import BadInput, NothingThere, UsageError
from shm.inference import class_probabilities, update
from shm.inference.options import Progress, silent
from shm.models import build, class_of
from shm.models.effects import EFFECTS, Parameter, Variant, parameters_of
from shm.models.one_hanger.adopted import (
    AdoptedEffect,
    AdoptedName,
    bounds_of,
    in_log,
    missed_by_one_test,
    parameter_name,
    places_of,
    variant_of,
)
from shm.pipeline.lineage import update_terms
from shm.pipeline.steps import options_of
from shm.store import (
    Adoption,
    Baseline,
    Store,
    StoredAdoption,
    StoredDiagnosis,
    StoredSelection,
    StoredTest,
    Workspace,
)
from shm.store.watch import find_latest_diagnosis, list_adoptions
from shm.values import BaselineCheck, Cause, EffectEstimate, Hanger
from shm.values.diagnosis import joined
from shm.watch import gap_percent, has_grown
from shm.watch.engine.options import reference_of


@dataclass(frozen=True)
class AdoptionRequest:
    """Request to adopt `effects`, each at a place (`at`) unless the diagnosis tells it.

    `baseline` is the class to which they are added; empty: that of the latest diagnosis,
    without one the hanger's own.
    """

    effects: tuple[str, ...]
    at: tuple[str, ...]
    baseline: str
    why: str
    who: str


@dataclass(frozen=True)
class GapWatch:
    """Gap since an adoption: `now_percent` is NaN before the next test."""

    adopted: StoredAdoption
    now_percent: float
    has_grown: bool

    def __str__(self) -> str:
        made = self.adopted.adoption
        now = "no test since" if math.isnan(self.now_percent) else f"{self.now_percent:.2f} % now"
        grown = ", grown: diagnose it again" if self.has_grown else ""
        before = f"gap {_percent(made.gap_before_percent)} rms before adoption"
        no_nearer = made.gap_percent >= made.gap_before_percent
        doubt = "Doubtful, the model comes no nearer to the tests: " if no_nearer else ""
        return (
            f"{doubt}{made.baseline_model} with {made.effect} ({made.at}), adopted "
            f"{self.adopted.adopted_at:%Y-%m-%d}: {before}, {_percent(made.gap_percent)} with it, "
            f"{now}{grown}."
        )


def _percent(value: float) -> str:
    return "not known" if math.isnan(value) else f"{value:.2f} %"


def gap_watch(store: Store, hanger: int) -> GapWatch | None:
    """The gap of the class that a hanger has adopted last; None where none is in force."""
    adopted = list_adoptions(store, hanger)
    if not adopted:
        return None
    made = adopted[-1].adoption
    latest, baseline = store.posteriors.get(hanger), store.watch.baseline(hanger)
    since = latest.model == made.model and (
        baseline is None or latest.tests != baseline.posterior.tests
    )
    now = gap_percent(latest) if since else math.nan
    return GapWatch(adopted[-1], now, has_grown(made.gap_percent, now))


def adopt(
    workspace: Workspace,
    store: Store,
    hanger: Hanger,
    request: AdoptionRequest,
    at: datetime,
    progress: Progress = silent,
) -> StoredAdoption:
    """Computes what an adoption needs and puts it in force, all in one transaction.

    Raises NothingThere where the hanger has no baseline yet, UsageError where the wish cannot be
    met, BadInput where the class cannot describe the tests of the baseline.
    """
    before, baseline = _in_force(store, hanger)
    diagnosis = find_latest_diagnosis(store, hanger.id)
    tests = store.tests.list_all(hanger.id)
    # Without a diagnosis the class in force: it is the one whose gap is told as that before.
    in_force = "" if diagnosis else baseline.posterior.model.partition("+")[0]
    known = request.baseline or in_force
    name = adopted_name(request.effects, request.at, known, hanger, diagnosis, tests)
    _refuse_second(store, hanger, str(name))
    chosen = [test for test in tests if test.test.id in baseline.posterior.tests]
    terms, lineage = update_terms(hanger, [str(name)], chosen, workspace.settings)
    check = baseline.posterior.baseline_check or BaselineCheck()
    measured = check.accepted_tests([test.test for test in chosen])
    posterior = update(
        measured,
        build(str(name), hanger, terms.priors),
        options_of(terms, hanger),
        progress,
        warm_start=baseline.posterior,
    )
    posterior = replace(posterior, baseline_check=baseline.posterior.baseline_check)
    gaps = gap_percent(baseline.posterior), gap_percent(posterior)
    adoption = _adoption(name, hanger, request, gaps, diagnosis.id if diagnosis else None)
    competing = [*before.selection.posteriors, posterior]
    models = [class_of(each, hanger) for each in competing]
    probabilities = class_probabilities(competing, models, measured)
    return store.posteriors.adopt(adoption, posterior, probabilities, (before, chosen), lineage, at)


def _in_force(store: Store, hanger: Hanger) -> tuple[StoredSelection, Baseline]:
    selection, baseline = store.posteriors.selection(hanger.id), store.watch.baseline(hanger.id)
    if selection is None or baseline is None:
        raise NothingThere(
            f"hanger {hanger.id} has no baseline yet, and so no gap.",
            remedy="Take in its first tests with `shm ingest FILE`.",
        )
    return selection, baseline


def _refuse_second(store: Store, hanger: Hanger, model: str) -> None:
    """Said before the work is done, not after."""
    if any(each.adoption.model == model for each in list_adoptions(store, hanger.id)):
        raise UsageError(
            f"hanger {hanger.id} has adopted {model} already.", remedy="See `shm gap adopted`."
        )


def _adoption(
    name: AdoptedName,
    hanger: Hanger,
    request: AdoptionRequest,
    gaps: tuple[float, float],
    diagnosis_id: int | None,
) -> Adoption:
    return Adoption(
        hanger=hanger.id,
        model=str(name),
        baseline_model=name.baseline,
        effect=joined(each.effect for each in name.effects),
        at=joined(variant_of(each, hanger).at for each in name.effects),
        why=request.why,
        who=request.who,
        gap_before_percent=gaps[0],
        gap_percent=gaps[1],
        diagnosis_id=diagnosis_id,
    )


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
    reference_c = reference_of([each.test.temperature_c for each in diagnosed])
    parts = [
        _part(effect, place, reference_c, hanger, cause)
        for effect, place in zip(effects, places, strict=True)
    ]
    known = stored.diagnosis.baseline if stored and not baseline else baseline
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
    is_diagnosed = cause is not None and Variant(_place_in(cause, effect)).key == key
    missed = missed_by_one_test(effect, hanger)
    if missed and not is_diagnosed:
        raise BadInput(
            f"a single test cannot show {effect}, so that its size must come from a diagnosis of "
            f"many. {missed}",
            remedy=f"Diagnose first: `shm gap diagnose --hanger {hanger.id}`.",
        )
    found = _estimates(effect, cause) if cause is not None and is_diagnosed else {}
    ranges = {
        parameter_name(each): _range(each, found[each.name])
        for each in parameters_of(effect, hanger, variant_of(part, hanger))
        if each.name in found and (missed or math.isnan(each.zero))
    }
    return replace(part, ranges=ranges)


def _place_in(cause: Cause, effect: str) -> str:
    return dict(zip(cause.effects, cause.places, strict=True))[effect]


def _estimates(effect: str, cause: Cause) -> dict[str, EffectEstimate]:
    """Return the diagnosis's estimates; of a pair, shared names are those of their effect."""
    return {each.name.removeprefix(f"{effect}."): each for each in cause.parameters}


def _range(parameter: Parameter, found: EffectEstimate) -> tuple[float, float]:
    """The range whose middle 90 % is the diagnosis's 90 % interval, within the catalogue's."""
    low, high = (math.log10(q) if in_log(parameter) else q for q in (found.q05, found.q95))
    middle, half = (low + high) / 2, (high - low) / 2 / _SHARE
    least, most = bounds_of(parameter)
    return max(middle - half, least), min(middle + half, most)
