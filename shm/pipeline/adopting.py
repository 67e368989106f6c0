"""Making a baseline with effects the model class of a hanger, and watching what became of its gap.

The tests that made the hanger's baseline are updated anew in the adopted class: from then on that
posterior is the baseline, so that what has moved since the first tests still shows. Nothing is
computed twice and nothing is lost: the former posteriors compete beside it in the selection on
record, and dropping the adoption puts them in force again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime

from shm.errors import NothingThere, UsageError
from shm.inference import class_probabilities, update
from shm.inference.options import Progress, silent
from shm.models import build, class_of
from shm.models.adopted import AdoptedName, variant_of
from shm.pipeline.calibrating import options_of
from shm.pipeline.lineage import update_terms
from shm.pipeline.naming import adopted_name
from shm.store import Adoption, Baseline, Store, StoredAdoption, StoredSelection, Workspace
from shm.values import Hanger
from shm.values.diagnosis import joined
from shm.watch import gap_percent, has_grown


@dataclass(frozen=True)
class Wish:
    """What is to be adopted: `effects` and, unless the diagnosis tells, where each acts (`at`).

    `baseline` is the class to which they are added; empty: that of the latest diagnosis, or beam1.
    """

    effects: tuple[str, ...]
    at: tuple[str, ...]
    baseline: str
    why: str
    who: str


@dataclass(frozen=True)
class GapWatch:
    """What became of the gap since an adoption: `now_percent` is NaN before the next test."""

    adopted: StoredAdoption
    now_percent: float
    has_grown: bool

    def __str__(self) -> str:
        made = self.adopted.adoption
        now = "no test since" if math.isnan(self.now_percent) else f"{self.now_percent:.2f} % now"
        grown = ", grown: diagnose it again" if self.has_grown else ""
        before = f"gap {_percent(made.gap_before_percent)} rms before adoption"
        return (
            f"{made.baseline_model} with {made.effect} ({made.at}), adopted "
            f"{self.adopted.adopted_at:%Y-%m-%d}: {before}, {_percent(made.gap_percent)} with it, "
            f"{now}{grown}."
        )


def _percent(value: float) -> str:
    return "not known" if math.isnan(value) else f"{value:.2f} %"


def gap_watch(store: Store, hanger: int) -> GapWatch | None:
    """The gap of the class that a hanger has adopted last; None where none is in force."""
    adopted = store.posteriors.list_adoptions(hanger)
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
    wish: Wish,
    at: datetime,
    progress: Progress = silent,
) -> StoredAdoption:
    """Computes what an adoption needs and puts it in force, all in one transaction.

    Raises NothingThere where the hanger has no baseline yet, UsageError where the wish cannot be
    met, BadInput where the class cannot describe the tests of the baseline.
    """
    before, baseline = _in_force(store, hanger)
    diagnosis = store.posteriors.latest_diagnosis(hanger.id)
    tests = store.tests.list_all(hanger.id)
    name = adopted_name(wish.effects, wish.at, wish.baseline, hanger, diagnosis, tests)
    _refuse_second(store, hanger, str(name))
    chosen = [test for test in tests if test.test.id in baseline.posterior.tests]
    terms, lineage = update_terms(hanger, [str(name)], chosen, workspace.settings)
    measured = [test.test for test in chosen]
    posterior = update(
        measured,
        build(str(name), hanger, terms.priors),
        options_of(terms, hanger),
        progress,
        hint=baseline.posterior,
    )
    gaps = gap_percent(baseline.posterior), gap_percent(posterior)
    adoption = _adoption(name, hanger, wish, gaps, diagnosis.id if diagnosis else None)
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
    if any(each.adoption.model == model for each in store.posteriors.list_adoptions(hanger.id)):
        raise UsageError(
            f"hanger {hanger.id} has adopted {model} already.", remedy="See `shm gap adopted`."
        )


def _adoption(
    name: AdoptedName,
    hanger: Hanger,
    wish: Wish,
    gaps: tuple[float, float],
    diagnosis_id: int | None,
) -> Adoption:
    return Adoption(
        hanger=hanger.id,
        model=str(name),
        baseline_model=name.baseline,
        effect=joined(each.effect for each in name.effects),
        at=joined(variant_of(each, hanger).at for each in name.effects),
        why=wish.why,
        who=wish.who,
        gap_before_percent=gaps[0],
        gap_percent=gaps[1],
        diagnosis_id=diagnosis_id,
    )
