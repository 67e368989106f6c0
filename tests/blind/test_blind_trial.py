"""The blind trial: what it makes, and how it judges."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from shm.bridge import load_hanger
from shm.modes_document import load_modes
from tests.benchmarks import blind_families
from tests.benchmarks import blind_trial as trial
from tests.benchmarks.blind.layout import HANGER_FILE, MODES_FILE, key_beside, read_trial
from tests.benchmarks.blind.scores import case_scores
from tests.benchmarks.blind.sealing import key_of
from tests.helpers.trial_answers import plausible, some_truths


def planned(world: str, richness: str, effect: str) -> trial.Plan:
    kind = "one" if effect else "none"
    return trial.Plan("c0001", world, kind, richness, "beam1", (effect,))  # type: ignore[arg-type]


def test_every_twelve_hold_all_worlds_and_beam2_has_no_end_springs_to_find() -> None:
    found = trial.plans(48, 5)
    assert found == trial.plans(60, 5)[:48]
    for first in range(0, 48, 12):
        worlds = Counter(plan.world for plan in found[first : first + 12])
        assert worlds == {trial.SIMULATOR: 7, trial.ELEMENTS: 4, trial.BAR: 1}
    assert {plan.baseline for plan in found} == set(trial.BASELINES)
    springs = [p for p in found if trial.IN_BEAM2 in p.effects]
    assert springs
    assert {plan.baseline for plan in springs} == {"beam1"}


def test_elements_give_what_the_richness_says_and_keep_the_truth_to_themselves(
    tmp_path: Path,
) -> None:
    plan = planned(trial.ELEMENTS, trial.THREE, "point_mass")
    truth = trial.by_elements(tmp_path / "c0001", plan, np.random.SeedSequence(3))
    tests = load_modes(tmp_path / "c0001" / MODES_FILE)
    assert [(m.plane, m.order) for m in tests[0].modes] == [("transverse", n) for n in (1, 2, 3)]
    assert truth.left_out == ("point_mass",)
    written = "".join(path.read_text() for path in (tmp_path / "c0001").iterdir())
    assert "point_mass" not in written
    assert str(truth.tension_n) not in written
    hanger = load_hanger(tmp_path / "c0001" / HANGER_FILE)
    assert 0.6 < truth.tension_n / hanger.nominal_tension_n < 1.4


def test_a_size_grows_with_the_cause_and_lets_the_baseline_follow_what_it_can(
    tmp_path: Path,
) -> None:
    made = trial.gap_family.member(
        np.random.default_rng(1), 1, 0.07, 9.0, 9.0, 4e5, "point_mass", 5.0, 4.0, 1e-4, [6, 6]
    )
    sizes = [
        trial.size_of(made, "point_mass", kg, 4.0, 1e-4, (6, 6), "beam1") for kg in (0.1, 1.0, 5.0)
    ]
    assert 0 < sizes[0] < sizes[1] < sizes[2]
    three = trial.size_of(made, "point_mass", 5.0, 4.0, 1e-4, (3,), "beam2")
    assert three < sizes[2]


@pytest.mark.parametrize(
    ("hits", "of", "said"),
    [
        (10, 10, "met"),
        (8, 10, "met by the better end"),
        (60, 100, "missed"),
        (9, 9, "too few to judge"),
        (0, 0, "too few to judge"),
    ],
)
def test_a_mark_is_judged_by_the_better_end(hits: int, of: int, said: str) -> None:
    flags = [n < hits for n in range(of)]
    assert trial.share(flags, 0.95, 1.0)[1] == said


def test_a_trial_is_made_with_its_key_beside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        trial, "plans", lambda cases, seed: [planned(trial.ELEMENTS, trial.THREE, "")]
    )
    trial.make(tmp_path / "trial", 1, 4)
    found = read_trial(tmp_path / "trial")
    truths, seed = key_of(found, key_beside(tmp_path / "trial"))
    assert (found.cases, seed) == (("c0001",), 4)
    assert [truth.kind for truth in truths] == ["none"]


def test_marks_ask_of_what_was_solved_and_parts_sum_to_all() -> None:
    truths, rng = some_truths(48), np.random.default_rng(1)
    firsts = case_scores(truths, [plausible(truth, rng) for truth in truths])
    plans = trial.plans(48, 5)
    cases = [trial.Scored(plan, each, None) for plan, each in zip(plans, firsts, strict=True)]
    rows = {what: (said, verdict) for what, said, verdict in trial.marks(cases)}
    assert rows["Left out: a wrong effect blamed, at most 0.05"] == ("no case", "too few to judge")
    sound = sum(truth.kind == "none" for truth in truths)
    assert f"of {sound}: " in rows["False alarms, at most 0.03"][0]
    worlds = {trial.SIMULATOR, trial.ELEMENTS, trial.BAR}
    counts = [int(row[1]) for row in trial.by_part(cases) if row[0] in worlds]
    assert sum(counts) == 48
    assert len(trial.every_case(cases)) == 49


@pytest.mark.parametrize(("apart", "told"), [(0.01, ["sag", "timebase"]), (0.2, [])])
def test_a_family_claims_its_likeliest_group_unless_each_may_be_for_itself(
    apart: float, told: list[str]
) -> None:
    members = [{"hanger": 1, "probability": 0.9}, {"hanger": 2, "probability": 0.3}]
    causes = [
        {"effect": name, "group": group, "probability": probability, "members": members}
        for name, group, probability in (("sag", 0, 0.3), ("a", None, 0.35), ("timebase", 0, 0.2))
    ]
    found = {
        "causes": causes, "each_for_itself_probability": apart, "unknown_probability": 0.05
    }  # fmt: skip
    assert blind_families.claimed(found) == (told, {1} if told else set())
