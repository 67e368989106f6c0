"""Judge diagnoses whose numbers are chosen: each outcome, and each reason for what is open."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shm.models.effects import EFFECTS
from shm.values import (
    NAN,
    Cause,
    Diagnosis,
    Outcome,
    Outlier,
    Residual,
    Shrinkage,
    group_causes,
    judge,
)
from shm.values.verdict import DESCRIPTION_EFFECTS
from tests.helpers.diagnoses import MASS, WARMTH, a_diagnosis

GUIDE = Outlier("transverse", 3, "t1", 28.0, 21.0, 0.1, 0.99, acts_alone=0.3)


def leave(rms_z: float, p_value: float = 0.4) -> Diagnosis:
    """Return a diagnosis whose leading cause leaves residuals of this size."""
    where = tuple(
        Residual("transverse", order, "t1", 5.8, 5.9, -1.7, -17.0, 0.6, after_z=sign * rms_z)
        for order, sign in ((1, 1), (2, -1), (3, 1), (4, -1))
    )
    return replace(a_diagnosis(), where=where, fit_p_value=p_value)


def cause(effect: str, probability: float, group: int | None = None, bayes: float = 14.0) -> Cause:
    return replace(
        MASS, effect=effect, probability=probability, group=group, log_bayes_factor=bayes
    )


LED = leave(1.0)
FAINT = replace(LED, causes=(cause("point_mass", 0.6, bayes=2.9),))
STRONG = replace(LED, causes=(cause("point_mass", 0.3, bayes=300.0),), unexplained_probability=0.68)


@pytest.mark.parametrize(
    ("diagnosis", "outcome", "reason"),
    [
        (LED, Outcome.EXPLAINED, ""),
        (leave(2.0, 0.01), Outcome.EXPLAINED, ""),
        (leave(2.01), Outcome.PARTLY, "large residuals"),
        (leave(30.0, 0.4), Outcome.PARTLY, "large residuals"),
        (replace(leave(6.0), shrinkage=Shrinkage(0.113, 0.114, 0.14, 0.13)), Outcome.UNEXPLAINED,
         "weak evidence"),  # frequencies come no nearer
        (leave(1.0, 0.009), Outcome.PARTLY, "poor fit"),
        (leave(NAN), Outcome.EXPLAINED, ""),  # of a former version: by the p-value alone
        (leave(NAN, 0.009), Outcome.PARTLY, "poor fit"),
        (replace(leave(NAN), shrinkage=Shrinkage(3.0, 1.4, 3.3, 1.8)), Outcome.PARTLY,
         "large misfit"),
        (replace(LED, shrinkage=Shrinkage(3.0, 1.4, 3.3, 1.8)), Outcome.EXPLAINED, ""),
        (leave(NAN, NAN), Outcome.PARTLY, "poor fit"),
        (replace(LED, outliers=(GUIDE,)), Outcome.PARTLY, "acts alone"),
        (replace(FAINT, fit_p_value=0.001), Outcome.UNEXPLAINED, "weak evidence"),
        (FAINT, Outcome.EXPLAINED, ""),
        (STRONG, Outcome.UNEXPLAINED, "much would fit"),
        (replace(STRONG, fit_p_value=1e-6), Outcome.PARTLY, "poor fit"),
        (
            replace(FAINT, unexplained_probability=0.7),
            Outcome.UNEXPLAINED,
            "unknown is more probable",
        ),
        (replace(LED, causes=()), Outcome.UNEXPLAINED, "unknown is more probable"),
        (
            replace(LED, no_gap_probability=0.04, unexplained_probability=0.47,
                    causes=(cause("point_mass", 0.49),)),
            Outcome.UNEXPLAINED,
            "none is more probable than not",
        ),
        (replace(LED, effective_draws=199.0), Outcome.UNEXPLAINED, "sampler failed"),
        (replace(LED, effective_draws=200.0), Outcome.EXPLAINED, ""),
        # The hanger alone fits as well, by a description that is far off.
        (replace(LED, shrinkage=Shrinkage(0.1, 0.1001, 0.15, 0.13)), Outcome.EXPLAINED, ""),
        (
            replace(LED, no_gap_probability=NAN, unexplained_probability=NAN,
                    causes=(cause("point_mass", NAN),)),
            Outcome.UNEXPLAINED,
            "no probabilities",
        ),
    ],
)  # fmt: skip
def test_judge_gap(diagnosis: Diagnosis, outcome: Outcome, reason: str) -> None:
    found = judge(diagnosis)
    assert (found.outcome, found.reason) == (outcome, reason)
    assert (found.claim is None) == (outcome is Outcome.UNEXPLAINED)
    assert found.is_within_errors <= (diagnosis.fit_p_value >= 0.01)


def without_gap(no_gap: float, rms_z: float = 1.0, rms_percent: float = 0.1) -> Diagnosis:
    where = tuple(replace(each, z=rms_z, after_z=NAN) for each in LED.where)
    return replace(
        LED,
        where=where,
        no_gap_probability=no_gap,
        shrinkage=Shrinkage(rms_percent, NAN, NAN, NAN),
        causes=(cause("point_mass", 0.9 - no_gap),),
        unexplained_probability=0.1,
    )


@pytest.mark.parametrize(
    ("diagnosis", "reason"),
    [
        (without_gap(0.9), ""),
        (without_gap(0.05), "less probable than not"),
        (without_gap(0.9, rms_z=2.1), "misses the errors"),
        (replace(without_gap(0.9), fit_p_value=0.001), "misses the errors"),
        (without_gap(0.9, rms_percent=1.1), "misses by percents"),
        (replace(without_gap(0.9), where=without_gap(0.9).where[:3]), "few modes"),
        (
            replace(without_gap(0.9, rms_z=2.1), where=without_gap(0.9, rms_z=2.1).where[:3]),
            "misses the errors",
        ),
    ],
)
def test_judge_no_gap(diagnosis: Diagnosis, reason: str) -> None:
    found = judge(diagnosis)
    assert (found.outcome, found.reason) == (Outcome.NO_GAP, reason)
    assert found.claim is None
    assert (found.runner_up is not None) == (reason == "less probable than not")
    assert found.probability == diagnosis.no_gap_probability


def test_judge_unknown_leads_beyond_errors() -> None:
    """A gap by its definition, and most probably of something unknown."""
    beyond, seldom = without_gap(0.3, rms_z=2.1), (cause("point_mass", 0.1),)
    found = judge(replace(beyond, causes=seldom, unexplained_probability=0.6))
    assert (found.outcome, found.reason) == (Outcome.UNEXPLAINED, "unknown is more probable")
    assert found.probability == 0.6
    within = judge(replace(without_gap(0.3), unexplained_probability=0.6))
    assert within.outcome is Outcome.NO_GAP


def test_judge_does_not_call_unknown_probable_beside_a_likelier_cause() -> None:
    """Something unknown leads before no gap, and a cause before it."""
    likelier = (cause("partial_mass", 0.6),)
    found = without_gap(0.1, rms_z=2.1)
    found = replace(found, causes=likelier, unexplained_probability=0.11)
    verdict = judge(found)
    assert (verdict.outcome, verdict.reason) == (Outcome.UNEXPLAINED, "weak evidence")
    assert verdict.runner_up is not None
    assert verdict.runner_up.causes == likelier


def test_judge_no_gap_with_outlier() -> None:
    found = judge(replace(without_gap(0.9), outliers=(GUIDE,)))
    assert (found.outcome, found.reason) == (Outcome.UNEXPLAINED, "acts alone")
    assert found.alone is GUIDE
    slip = replace(GUIDE, acts_alone=0.04)
    assert judge(replace(without_gap(0.9), outliers=(slip,))).outcome is Outcome.NO_GAP


def test_judge_leaves_out_excluded_residuals() -> None:
    slip = replace(GUIDE, acts_alone=0.0)
    where = (*LED.where[:2], replace(LED.where[2], after_z=400.0), LED.where[3])
    assert judge(replace(LED, where=where)).outcome is Outcome.PARTLY
    found = judge(replace(LED, where=where, outliers=(slip,)))
    assert found.outcome is Outcome.EXPLAINED
    assert found.rms_z == pytest.approx(1.0)


def test_judge_group() -> None:
    several = (cause("sag", 0.4, 0), cause("timebase", 0.3, 0), cause("point_mass", 0.2))
    found = judge(replace(LED, causes=several, unexplained_probability=0.08))
    assert found.outcome is Outcome.ALIKE
    assert found.claim == group_causes(several)[0]
    assert found.probability == pytest.approx(0.7)
    left = judge(replace(leave(5.0), causes=several, unexplained_probability=0.08))
    assert left.outcome is Outcome.PARTLY
    assert left.claim == found.claim


def test_judge_joins_causes_until_half() -> None:
    several = (cause("sag", 0.4), cause("timebase", 0.3), cause("point_mass", 0.2))
    found = judge(replace(LED, causes=several, unexplained_probability=0.08))
    assert found.outcome is Outcome.ALIKE
    assert found.claim is not None
    assert [each.effect for each in found.claim.causes] == ["sag", "timebase"]


@pytest.mark.parametrize("effect", DESCRIPTION_EFFECTS)
def test_judge_description_off(effect: str) -> None:
    assert effect in EFFECTS
    alone = replace(LED, causes=(cause(effect, 0.9),))
    pair = replace(LED, causes=(replace(cause(f"sag + {effect}", 0.9), at="a + b"),))
    member = replace(LED, causes=(cause("sag", 0.8, 0), cause(effect, 0.1, 0)))
    other = replace(LED, causes=(cause("sag", 0.8), cause(effect, 0.1)))
    assert [judge(each).is_description_off for each in (alone, pair, member, other)] == [
        True,
        True,
        True,
        False,
    ]


def test_judge_uncertain() -> None:
    assert judge(replace(LED, effective_draws=12.0)).is_uncertain
    assert not judge(LED).is_uncertain
    no_gap = judge(replace(without_gap(0.9), effective_draws=12.0))
    assert no_gap.outcome is Outcome.NO_GAP
    assert no_gap.is_open


@pytest.mark.parametrize(
    ("before", "after", "holds"), [(2.5, 2.0, True), (2.5, 2.1, False), (NAN, NAN, None)]
)
def test_judge_held_out(before: float, after: float, holds: bool | None) -> None:
    shrinkage = Shrinkage(2.3, 0.6, before, after)
    assert judge(replace(LED, shrinkage=shrinkage)).holds_out is holds


def test_group_causes_order() -> None:
    found = group_causes((WARMTH, cause("sag", 0.03, 1), cause("timebase", 0.04, 1)))
    assert [[each.effect for each in claim.causes] for claim in found] == [
        ["timebase", "sag"],
        ["temperature_tension"],
    ]
