"""Score the answers of `blind_trial.py` by the truth: one function, `score`, gives all marks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from shm.diagnosis_document import diagnosis_of
from shm.report.diagnosis_summary import write_lead
from shm.values import Diagnosis, Outcome
from shm.values.leading import MIN_NO_GAP_PROBABILITY
from shm.values.posterior import ENOUGH_EFFECTIVE
from shm.values.verdict import MAX_RMS_Z, MIN_FIT_P_VALUE, is_excluded
from tests.benchmarks.shares import interval

SURE, STATED = 0.8, 0.9
MANY_DATA = 60
CLAIMS = (Outcome.EXPLAINED, Outcome.ALIKE, Outcome.PARTLY)


@dataclass(frozen=True)
class Row:
    """A hanger's truth beside the answer; `diagnosis` is None where it was refused."""

    truth: dict[str, Any]
    answer: dict[str, Any]

    @cached_property
    def diagnosis(self) -> Diagnosis | None:
        """Return the diagnosis as its reader gets it."""
        document = self.answer.get("diagnosis")
        return diagnosis_of(document) if document else None

    @property
    def outcome(self) -> Outcome | None:
        """Return the verdict's outcome."""
        return self.diagnosis.verdict.outcome if self.diagnosis else None

    @property
    def is_without(self) -> bool:
        """Return whether the true causes were taken out of the catalogue."""
        return bool(self.answer["without"])

    @property
    def is_sound(self) -> bool:
        """Return whether nothing was planted."""
        return not self.truth["causes"]

    @cached_property
    def in_class(self) -> bool:
        """Return whether all planted causes are parameters of the model class itself."""
        itself = effects_of_class(self.answer)
        accepted = [set(each["accepted"]) for each in self.truth["causes"]]
        return bool(accepted) and all(each & itself for each in accepted)

    @property
    def first(self) -> frozenset[str]:
        """Return the effects of the cause that the verdict names first."""
        claim = self.diagnosis.verdict.claim if self.diagnosis else None
        return frozenset(claim.leading.effects) if claim else frozenset()

    @cached_property
    def claimed(self) -> tuple[frozenset[str], ...]:
        """Return the causes that the verdict names, or cannot tell from these, by their effects."""
        verdict = self.diagnosis.verdict if self.diagnosis else None
        if self.diagnosis is None or verdict is None or verdict.claim is None:
            return ()
        groups = {each.group for each in verdict.claim.causes} - {None}
        alike = [each for each in self.diagnosis.causes if each.group in groups]
        return tuple(frozenset(each.effects) for each in (*verdict.claim.causes, *alike))

    @property
    def named(self) -> frozenset[str]:
        """Return the effects of all these causes."""
        return frozenset[str]().union(*self.claimed)

    @property
    def probability(self) -> float:
        """Return what the verdict states as probability of its answer."""
        return self.diagnosis.verdict.probability if self.diagnosis else math.nan

    @property
    def is_right(self) -> bool:
        """Return whether the answer is true.

        Right are a planted cause among those named, or one by which a sound hanger differs, too;
        no gap where there is none, or where the class has the cause itself; not explained where
        the catalogue has no such cause.
        """
        if self.outcome in CLAIMS:
            true = set() if self.is_without else set(self.truth["accepted"])
            inherent = set(self.truth["inherent"])
            return bool(self.named & true) or any(each <= inherent for each in self.claimed)
        if self.outcome is Outcome.NO_GAP:
            return self.is_sound or self.in_class
        is_unlisted = self.is_without or not (self.is_sound or self.truth["accepted"])
        return self.outcome is not None and is_unlisted

    @property
    def has_false_partner(self) -> bool:
        """Return whether the first cause is a pair of a planted effect with a false one."""
        planted = set(self.truth["accepted"])
        return bool(self.first & planted) and not self.first <= planted | set(
            self.truth["inherent"]
        )

    @property
    def is_false_cause(self) -> bool:
        """Return whether a cause is named and nothing that is named is true."""
        return self.outcome in CLAIMS and not self.is_right

    @property
    def holds(self) -> bool:
        """Return whether the 95 % interval holds the true tension."""
        if self.diagnosis is None:
            return False
        after = self.diagnosis.tension_after_n
        return bool(after.q025 <= self.truth["tension_n"] <= after.q975)

    def error(self, when: str) -> float:
        """Return the relative error of the tension `before` or `after`."""
        found = getattr(self.diagnosis, f"tension_{when}_n")
        return float(found.mean / self.truth["tension_n"] - 1)


def effects_of_class(answer: dict[str, Any]) -> set[str]:
    """Return the effects that are parameters of the model class that the diagnosis chose."""
    invisible = answer.get("diagnosis", {}).get("invisible", [])
    return {each["effect"] for each in invisible if "parameters of its own" in each["why"]}


def find_contradictions(found: Diagnosis) -> list[str]:
    """Return where verdict, probabilities, remarks, residuals and interval contradict each other.

    All is computed here once more from the document, as a distrustful reader would.
    """
    verdict, none = found.verdict, found.no_gap_probability
    is_claim = verdict.outcome in CLAIMS
    said = []
    total = none + found.unexplained_probability + sum(each.probability for each in found.causes)
    if not math.isclose(total, 1.0, abs_tol=1e-6):
        said.append(f"probabilities add to {total:.4f}")
    if is_claim and none >= MIN_NO_GAP_PROBABILITY:
        said.append(f"a cause is named while no gap has {none:.2f}")
    if verdict.outcome is Outcome.NO_GAP and none < MIN_NO_GAP_PROBABILITY:
        said.append(f"no gap is stated with {none:.2f}")
    is_explained = is_claim and verdict.outcome is not Outcome.PARTLY
    claim = verdict.claim
    if is_explained and (claim is None or found.leading not in claim.causes):
        said.append("another cause leads than the verdict names")
    is_settled = is_explained or (verdict.outcome is Outcome.NO_GAP and not verdict.reason)
    left = _rms_z(found, "z" if verdict.outcome is Outcome.NO_GAP else "after_z")
    if is_settled and (left > MAX_RMS_Z or found.fit_p_value < MIN_FIT_P_VALUE):
        said.append(f"settled, with residuals of {left:.1f} sd, p {found.fit_p_value:.2g}")
    shrinkage = found.shrinkage
    no_nearer = shrinkage.rms_after_percent >= shrinkage.rms_before_percent
    if is_claim and no_nearer and _rms_z(found, "z") > MAX_RMS_Z:
        said.append("a cause is named that brings the frequencies no nearer")
    failed = [each for each in found.remarks if each.startswith("The sampler failed")]
    if is_settled and (failed or found.effective_draws < ENOUGH_EFFECTIVE):
        said.append("settled, though the sampler failed")
    doubted = [each for each in found.remarks if each.startswith("Doubtful")]
    if doubted and "of this hanger" not in write_lead(found):
        said.append("a remark doubts that the tests are of this hanger, the verdict does not")
    before, after = found.tension_before_n, found.tension_after_n
    for each in (before, after):
        ordered = [each.q025, each.q05, each.mean, each.q95, each.q975]
        if all(map(math.isfinite, ordered)) and ordered != sorted(ordered):
            said.append("the interval of the tension does not hold its mean")
    if none >= STATED and not before.q025 <= after.mean <= before.q975:
        said.append("no gap, but another tension than without one")
    return said


def _rms_z(found: Diagnosis, field: str) -> float:
    z = [getattr(each, field) for each in found.where if not is_excluded(found, each)]
    finite = [each for each in z if math.isfinite(each)]
    return float(np.sqrt(np.mean(np.square(finite)))) if finite else math.nan


@dataclass(frozen=True)
class Mark:
    """A line of the table; `is_met` is None where nothing was asked, or there is no case."""

    what: str
    asked: str
    reached: str
    is_met: bool | None = None


def count(
    what: str,
    rows: Sequence[Row],
    test: Callable[[Row], bool],
    least: float = -math.inf,
    most: float = math.inf,
) -> Mark:
    """Return the mark of a fraction of rows, asked to be at least or at most so much."""
    n, k = len(rows), sum(test(row) for row in rows)
    asked = f">= {least:g}" if least > 0 else f"<= {most:.2g}" if most < 1 else ""
    if not n:
        return Mark(what, asked, "no case")
    low, high = interval(k, n)
    reached = f"{k} of {n}: {k / n:.2f} ({low:.2f} to {high:.2f})"
    return Mark(what, asked, reached, least <= k / n <= most if asked else None)


def score(rows: Sequence[Row]) -> list[Mark]:
    """Return all marks of a trial."""
    done = [row for row in rows if row.diagnosis]
    full = [row for row in done if not row.is_without]
    less = [row for row in done if row.is_without]
    sound = [row for row in full if row.is_sound]
    listed = [row for row in full if row.truth["accepted"]]
    asked = [row for row in listed if not row.in_class]
    itself = [row for row in listed if row.in_class]
    foreign = [row for row in full if not row.is_sound and not row.truth["accepted"]]

    def is_planted(row: Row, names: frozenset[str]) -> bool:
        return bool(names & set(row.truth["accepted"]))

    def is_sure_and_wrong(row: Row) -> bool:
        return row.is_false_cause and row.probability > SURE

    def nearest(row: Row) -> frozenset[str]:
        causes = row.diagnosis.causes if row.diagnosis else ()
        best = max(causes, key=lambda each: each.probability, default=None)
        return frozenset(best.effects if best else ())

    stated = [row for row in full if row.outcome in CLAIMS and row.probability >= STATED]
    return [
        Mark("refused", "", f"{len(rows) - len(done)} of {len(rows)}"),
        count("gap claimed on sound hangers", sound, _claims_a_gap, most=1 / 20),
        count("a false cause named, sound hangers", sound, lambda r: r.is_false_cause),
        count("cause named first", asked, lambda r: is_planted(r, r.first), least=0.75),
        count("cause named first or in its group", asked, lambda r: is_planted(r, r.named), 0.92),
        count("cause named first with a false partner", asked, lambda r: r.has_false_partner),
        count("cause most probable, named or not", asked, lambda r: is_planted(r, nearest(r))),
        count("cause missed: no gap stated", asked, lambda r: r.outcome is Outcome.NO_GAP),
        count("cause missed: not explained", asked, lambda r: r.outcome is Outcome.UNEXPLAINED),
        count("cause missed: a false cause named", asked, lambda r: r.is_false_cause),
        count("cause that the class has itself: no gap stated", itself, lambda r: r.is_right),
        count("cause off the catalogue: a false cause named", foreign, lambda r: r.is_false_cause),
        count(f"sure (> {SURE}) and wrong", full, is_sure_and_wrong, most=1 / 30),
        count("sure and wrong, true cause left out", less, is_sure_and_wrong, most=1 / 10),
        count("a false cause named, true cause left out", less, lambda r: r.is_false_cause),
        count(f"cause stated with {STATED} or more: right", stated, lambda r: r.is_right, 0.88),
        count("95 % interval of the tension holds", done, lambda r: r.holds, least=0.92),
        count("95 % interval, sound hangers", sound, lambda r: r.holds),
        count("95 % interval, true cause left out", less, lambda r: r.holds),
        *_quantities(full),
        count("answers that contradict themselves", done, _contradicts, most=0.0),
    ]


def _claims_a_gap(row: Row) -> bool:
    return row.outcome is not Outcome.NO_GAP


def _contradicts(row: Row) -> bool:
    return bool(row.diagnosis and find_contradictions(row.diagnosis))


def _quantities(full: Sequence[Row]) -> list[Mark]:
    """Return the marks of the tension's error and of the time, of the whole catalogue."""
    if not full:
        return []
    before, after = ([abs(row.error(when)) for row in full] for when in ("before", "after"))
    small = [row for row in full if row.diagnosis and len(row.diagnosis.where) <= MANY_DATA]
    seconds = [float(row.answer["processor_s"]) for row in small]
    error = f"{np.median(before):.1%} -> {np.median(after):.1%}"
    found = [
        Mark(
            "error of the tension, median, before -> after",
            "after <= 1.5 %",
            f"{error} (worst {max(before):.0%} -> {max(after):.0%})",
            bool(np.median(after) <= 0.015),
        )
    ]
    if seconds:
        spent = f"{np.median(seconds):.0f}, {max(seconds):.0f} ({len(small)} hangers)"
        is_quick = bool(np.median(seconds) <= 10 and max(seconds) <= 30)
        what = f"processor seconds up to {MANY_DATA} data, median and worst"
        found.append(Mark(what, "<= 10, <= 30", spent, is_quick))
    return found


def table(marks: Sequence[Mark]) -> str:
    """Return the marks as Markdown."""
    met = {True: "yes", False: "no", None: ""}
    rows = [f"| {m.what} | {m.asked} | {m.reached} | {met[m.is_met]} |" for m in marks]
    return "\n".join(
        ["| mark | asked | reached (90 % interval) | met |", "|---|---|---|---|", *rows]
    )
