"""A cause that hangers share, from likelihoods that are known in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from shm.errors import UsageError
from shm.gap import GapOptions, diagnose_bridge
from shm.gap.bridge.bridge_diagnosis import diagnose_jointly
from shm.gap.bridge.shared_causes import find_groups, sum_two_or_more
from shm.gap.bridge.shared_evidence import (
    SHARING,
    EffectEvidence,
    HangerEvidence,
    Place,
    Sizes,
    weigh_hanger,
)
from shm.gap.causes.probabilities import NO_GAP, SINGLE, UNKNOWN
from shm.gap.causes.scan import VISIBLE
from shm.gap.causes.search import Attribution, attribute
from shm.models.effects import EFFECTS, Variant
from shm.report.as_text import as_text
from shm.report.bridge_diagnosis_report import bridge_diagnosis_paper
from shm.report.contents import BridgeDiagnosisSheet
from shm.report.figures.gap_causes import SHARED
from shm.report.figures.specification import drawn
from shm.simulate import PlantedEffect
from shm.values import BridgeDiagnosis, Hanger, ModalTest
from tests.helpers.diagnoses import a_diagnosis
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import problem_of, simulated
from tests.helpers.hangers import HANGER_3, ROD

MASS: Place = ("distributed_mass", "everywhere")
CLOCK: Place = ("timebase", "all tests")
SIZES = Sizes(replace(EFFECTS[MASS[0]].parameters(HANGER_3, Variant())[0], upper=0.3))
"""Of 0.002 to 0.3, whatever the catalogue's range is: the closed forms here are of that."""
SOUND = {"no_gap": 3.2, "gap": 0.27, "unknown": 0.3}
"""A no-gap probability of 0.8, against a prior of 0.25."""
ILL = {"no_gap": 0.1, "gap": 1.3, "unknown": 0.8}


def evidence(
    bayes_factor: float, size: float, sd: float = 0.03, small_gain: float = 0.0
) -> EffectEvidence:
    """A size known to `sd` decades, and a tension that is known with it.

    Sizes too small to see are likelier than no effect by a log likelihood.
    """
    visible = np.log10(size) + sd * np.random.default_rng(3).standard_normal(400)
    small = SIZES.ends[0] - np.arange(SHARING.step / 2, SHARING.below, SHARING.step)
    x = np.append(visible, small)
    weight = np.append(
        np.full(400, bayes_factor * np.ptp(SIZES.ends) / 400),
        np.full(len(small), SHARING.step * np.exp(small_gain)),
    )
    is_visible, tension_n = np.arange(len(x)) < 400, 700e3 * (1 + 10**x)
    return EffectEvidence(SIZES, x, np.ones(len(x)), weight, is_visible, tension_n, -0.5)


def hanger(
    number: int, effects: dict[Place, EffectEvidence], said: dict[str, float]
) -> HangerEvidence:
    described: Hanger = replace(HANGER_3, id=number, length_m=8.0 + number)
    diagnosis = replace(a_diagnosis(), hanger=number)
    tension_n = 700e3 * (1 + 0.05 * np.random.default_rng(number).random(1000))
    tests = (ModalTest("t1", ()),)
    return HangerEvidence(described, tests, diagnosis, **said, tension_n=tension_n, effects=effects)


def bridge(factors: Sequence[float], sizes: Sequence[float]) -> BridgeDiagnosis:
    """Hangers for which the mass has these Bayes factors; the clock fits none of them."""
    return diagnose_jointly(
        [
            hanger(
                number,
                {MASS: evidence(factor, size), CLOCK: evidence(0.3, 0.004, 0.3)},
                ILL if factor > 1 else SOUND,
            )
            for number, (factor, size) in enumerate(zip(factors, sizes, strict=True), 1)
        ],
        GapOptions(),
    )


@pytest.fixture(scope="module")
def family() -> BridgeDiagnosis:
    """Four of six hangers are by 5 % too heavy, each of which alone is odds of 8."""
    return bridge((8, 8, 0.05, 8, 0.05, 8), (0.05, 0.052, 0.02, 0.048, 0.02, 0.051))


def test_what_no_hanger_shows_alone_the_family_does(family: BridgeDiagnosis) -> None:
    assert family.leading is not None
    assert family.leading.effect == "distributed_mass"
    assert family.leading.named == (1, 2, 4, 6)
    assert family.claim(family.leading) > 0.8
    assert family.leading.size.mean == pytest.approx(0.05, rel=0.1)
    told = sum(cause.probability for cause in family.causes)
    told += family.each_for_itself_probability + family.unknown_probability
    assert told == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("factors", "sizes", "least"),
    [
        ([0.3] * 8, [0.004] * 8, 0.7),  # sound hangers
        ([40.0, *[0.05] * 5], [0.05, *[0.02] * 5], 0.0),  # one with a cause of its own
    ],
)
def test_hangers_that_share_nothing(factors: list[float], sizes: list[float], least: float) -> None:
    found = bridge(factors, sizes)
    assert found.leads == "each for itself"
    assert found.each_for_itself_probability > least


def test_what_none_can_see_adds_up() -> None:
    def found(log_gain: float) -> BridgeDiagnosis:
        little = evidence(0.3, 0.003, small_gain=log_gain)
        return diagnose_jointly(
            [hanger(n, {MASS: little}, SOUND) for n in range(1, 11)], GapOptions()
        )

    assert found(0.0).leads == "each for itself"
    assert found(1.2).leading is not None
    assert found(-1.2).each_for_itself_probability > found(0.0).each_for_itself_probability


def test_sizes_that_differ_speak_against_a_common_cause() -> None:
    alike = bridge([8.0] * 4, [0.05] * 4).causes[0].log_bayes_factor
    apart = bridge([8.0] * 4, [0.004, 0.02, 0.08, 0.25]).causes[0].log_bayes_factor
    assert alike > apart + 3


def test_a_size_known_poorly_in_one_hanger_takes_that_of_the_others() -> None:
    poor = {MASS: evidence(8.0, 0.1, 0.4)}
    others = [hanger(n, {MASS: evidence(8.0, 0.05)}, ILL) for n in range(2, 7)]
    found = diagnose_jointly([hanger(1, poor, ILL), *others], GapOptions())
    assert found.leading is not None
    size = found.leading.members[0].size
    assert size.mean == pytest.approx(0.05, rel=0.2)
    assert size.sd < 0.3 * 0.1
    tension = found.tensions[0].jointly_n
    assert abs(tension.mean / (700e3 * 1.05) - 1) < 0.01


def test_a_hanger_that_cannot_show_it_neither_joins_nor_leaves() -> None:
    blind = hanger(9, {}, SOUND)
    shown = [hanger(n, {MASS: evidence(20.0, 0.05)}, ILL) for n in range(1, 5)]
    found = diagnose_jointly([*shown, blind], GapOptions())
    assert found.leading is not None
    assert 0.5 < found.leading.members[-1].probability < 0.95


def test_two_at_least_is_the_sum_over_all_such_choices() -> None:
    rng = np.random.default_rng(5)
    absent, present = rng.standard_normal((2, 5))
    whole = sum(
        np.exp(np.where(chosen, present, absent).sum())
        for chosen in product((False, True), repeat=5)
        if sum(chosen) >= 2
    )
    assert sum_two_or_more(absent, np.exp(present - absent)) == pytest.approx(np.log(whole))


def test_families_are_the_hangers_alike_each_set_once() -> None:
    made = [hanger(n, {}, SOUND) for n in range(1, 5)]
    older = [
        replace(each, hanger=replace(each.hanger, family="A" if n < 2 else "B"))
        for n, each in enumerate(made)
    ]
    found = {each.members: each.likeness for each in find_groups(older)}
    assert found[(0, 1, 2, 3)] == "all hangers"
    assert found[(0, 1)] == found[(2, 3)] == "hangers of one delivery"


def test_fewer_than_two_hangers_or_twice_the_same_are_wrong_usage() -> None:
    with pytest.raises(UsageError, match="two hangers"):
        diagnose_bridge([(HANGER_3, ())])
    with pytest.raises(UsageError, match="number 3"):
        diagnose_bridge([(HANGER_3, ()), (HANGER_3, ())])


def test_the_report_says_who_shares_what_in_plain_words(family: BridgeDiagnosis) -> None:
    text = as_text(bridge_diagnosis_paper(BridgeDiagnosisSheet(family, "Arch")), 100)
    assert "Distributed mass is shared by hangers 1, 2, 4 and 6 (" in " ".join(text.split())
    assert [each.name for each in drawn((SHARED,), family)] == ["shared"]
    assert max(map(len, text.splitlines())) <= 100


EVERYWHERE = ("distributed_mass", "everywhere")


def weigh(*planted: PlantedEffect) -> tuple[Attribution, HangerEvidence]:
    """Weigh a hanger by a catalogue of one effect."""
    tests = simulated(*planted, hanger=ROD, modes=5, shapes=False, as_made=False)
    options = GapOptions(without=all_but(EVERYWHERE[0]), draws=200)
    found = attribute(problem_of(tests, hanger=ROD), options, np.random.default_rng(1))
    return found, weigh_hanger(ROD, tests, a_diagnosis(), found, np.random.default_rng(1))


def test_visible_points_are_draws_of_the_size() -> None:
    """The likelihoods give the probabilities back, and the tension follows the size."""
    found, evidence = weigh(PlantedEffect(*EVERYWHERE, {"mass_change": 0.12}))
    effect = evidence.effects[EVERYWHERE]
    visible = effect.visible
    chance = SINGLE * effect.weight[visible].sum() / np.ptp(effect.sizes.ends)
    assert chance == pytest.approx(found.explanations[0].probability, rel=1e-6)
    assert NO_GAP * evidence.no_gap == pytest.approx(found.no_gap_probability)
    assert UNKNOWN * evidence.unknown == pytest.approx(found.unexplained_probability)
    low, high = effect.sizes.ends
    assert low <= effect.x[visible].min() <= effect.x[visible].max() <= high
    size = effect.sizes.value(effect.x[visible])
    assert np.quantile(size, 0.02) < 0.12 < np.quantile(size, 0.98)
    assert np.corrcoef(effect.x[visible], effect.tension_n[visible])[0, 1] > 0.5
    assert effect.tension_n[visible].mean() > effect.tension_n[~visible].mean()


def test_a_smaller_size_is_less_told_from_none() -> None:
    effect = weigh()[1].effects[EVERYWHERE]
    small = ~effect.visible
    order = np.argsort(effect.x[small])
    told = np.abs(np.log(effect.weight[small] / SHARING.step)[order])
    assert told[0] < 0.5 * told[-1]
    assert told.max() < VISIBLE**2
