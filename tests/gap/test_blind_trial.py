"""The sealed trial of the gap diagnosis: its hangers, its seal and its scores."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from shm.diagnosis_document import diagnosis_document
from shm.documents import dump
from shm.values import Diagnosis, TensionEstimate
from tests.benchmarks import blind_trial
from tests.benchmarks.blind_scores import Row, find_contradictions, score
from tests.benchmarks.blind_trial import COMPLETE, LEFT_OUT, Plan, Trial
from tests.helpers.diagnoses import MASS, WARMTH, a_diagnosis
from tests.worlds.gapped_hangers import CAUSES

TENSION = TensionEstimate(101.0, 1.0, 99.5, 102.5, 99.0, 103.0)
EXPLAINED = replace(a_diagnosis(), tension_before_n=TENSION, tension_after_n=TENSION)
SURE = replace(EXPLAINED, causes=(replace(MASS, probability=0.95),), no_gap_probability=0.02)
PAIR = replace(EXPLAINED, causes=(replace(MASS, effect="point_mass + sag", probability=0.95),))
UNKNOWN = replace(EXPLAINED, causes=(), unexplained_probability=0.98)
NO_GAP = replace(
    EXPLAINED,
    causes=(replace(MASS, probability=0.05),),
    no_gap_probability=0.92,
    where=(),
    shrinkage=replace(EXPLAINED.shrinkage, rms_before_percent=0.2),
)


ALIKE = tuple(replace(each, group=0, probability=0.4) for each in (MASS, WARMTH))
ITSELF = (("sag", "The baseline beam1 has it as parameters of its own."),)


def make_row(
    found: Diagnosis | None,
    *planted: str,
    inherent: tuple[str, ...] = (),
    without: tuple[str, ...] = (),
    accepted: bool = True,
) -> Row:
    causes = [
        {"cause": name, "accepted": [name] if accepted else [], "visible": 9.0} for name in planted
    ]
    truth = {"hanger": "h1", "world": "w", "kind": "bar", "tension_n": 100.0, "causes": causes}
    truth |= {"accepted": list(planted) if accepted else [], "inherent": dict.fromkeys(inherent, 4)}
    answer: dict[str, Any] = {"without": list(without), "processor_s": 3.0}
    if found is None:
        return Row(truth, answer | {"refused": "no modes"})
    return Row(truth, json.loads(dump(answer | {"diagnosis": diagnosis_document(found)})))


def test_plan_hangers_quarter_sound_each_cause_once() -> None:
    plans = blind_trial.plan_hangers(36, seed=3)
    assert plans == blind_trial.plan_hangers(36, seed=3)
    assert plans != blind_trial.plan_hangers(36, seed=4)
    sound = Counter(each.world for each in plans if not each.causes)
    assert sound == {blind_trial.GAPPED: 5, blind_trial.ELEMENTS: 4}
    planted = Counter(each.causes[0] for each in plans if each.causes)
    assert set(planted) == set(CAUSES)
    assert max(planted.values()) == 2
    assert sum(len(each.causes) == 2 for each in plans) == 3
    assert len({(each.world, each.index) for each in plans}) == 36
    assert [each.name for each in plans] == sorted(each.name for each in plans)
    half = [bool(each.causes) for each in plans[:18]]
    assert 9 <= sum(half) < 18  # sound ones stand neither first nor last


@pytest.mark.parametrize(
    ("plan", "causes", "accepted"),
    [
        (Plan("h001", blind_trial.ELEMENTS, 1), [], []),
        (Plan("h001", blind_trial.GAPPED, 0, ("mass all along",)),
         ["mass all along"], ["distributed_mass"]),
    ],
)  # fmt: skip
def test_make_hanger(tmp_path: Path, plan: Plan, causes: list[str], accepted: list[str]) -> None:
    folder = tmp_path / "h001"
    truth = blind_trial.make_hanger(plan, 3, folder)
    assert ([each["cause"] for each in truth["causes"]], truth["accepted"]) == (causes, accepted)
    assert all(each["visible"] >= 5 for each in truth["causes"])
    assert causes or truth["inherent"] == {}
    assert truth["tension_n"] > 0
    assert {each.name for each in folder.iterdir()} == {"hanger.toml", "case.modes.json"}
    assert "mass all along" not in (folder / "hanger.toml").read_text()


@pytest.fixture(scope="module")
def closed(tmp_path_factory: pytest.TempPathFactory) -> Trial:
    """Return a trial of one hanger that was diagnosed already, with the answers closed."""
    trial = Trial(tmp_path_factory.mktemp("blind") / "trial")
    blind_trial.make_trial(trial, 1, 1, seed=3)
    answer = {"without": [], "processor_s": 1.0, "diagnosis": diagnosis_document(EXPLAINED)}
    for which in (COMPLETE, LEFT_OUT):
        trial.answer(which, "h001").parent.mkdir()
        trial.answer(which, "h001").write_text(dump(answer))
    blind_trial.run(trial, jobs=1)
    return trial


@pytest.fixture
def trial(closed: Trial, tmp_path: Path) -> Trial:
    """Return a copy of the trial."""
    return Trial(Path(shutil.copytree(closed.folder, tmp_path / "trial")))


def test_run_opens_truth_when_answers_are_there(trial: Trial) -> None:
    assert trial.read()["answers_sha256"] == trial.hash_answers(COMPLETE)
    (row, again) = blind_trial.read_rows(trial)
    assert row.truth["hanger"] == again.truth["hanger"] == "h001"
    assert trial.open_truth()["h001"]["tension_n"] > 0


@pytest.mark.parametrize("changed", ["sealed/truth.json", "complete/h001.json"])
def test_open_truth_changed_since(trial: Trial, changed: str) -> None:
    """Nor before the answers, nor of a former version."""
    known = trial.read()
    trial.write({key: known[key] for key in known if key != "answers_sha256"})
    with pytest.raises(SystemExit, match="lacking"):
        trial.open_truth()
    trial.write(known)
    path = trial.folder / changed
    path.write_text(path.read_text() + " ")
    with pytest.raises(SystemExit, match="changed since"):
        trial.open_truth()
    trial.write(known | {"schema": "shm.blind_trial/1"})
    with pytest.raises(SystemExit, match=r"shm\.blind_trial/1"):
        trial.read()


@pytest.mark.slow
def test_guard_refuses_sealed_folder(trial: Trial, tmp_path: Path) -> None:
    """Neither by its path nor through a link; the hanger's files stay open."""
    (tmp_path / "link").symlink_to(trial.truth_file)
    program = (
        "import sys; from pathlib import Path\n"
        "from tests.benchmarks.blind_trial import guard\n"
        "sealed, *paths = sys.argv[1:]\n"
        "guard(sealed)\n"
        "for path in paths:\n"
        "    try:\n"
        "        Path(path).read_bytes(); print('read')\n"
        "    except PermissionError:\n"
        "        print('refused')\n"
    )
    paths = (trial.truth_file, tmp_path / "link", trial.hanger("h001") / "hanger.toml")
    folder = trial.truth_file.parent.resolve()
    said = subprocess.run(
        [sys.executable, "-c", program, str(folder), *map(str, paths)],
        cwd=blind_trial.ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert said.stdout.split() == ["refused", "refused", "read"]


def test_hangers_to_repeat() -> None:
    """Each planted cause must be in the catalogue, and none of them in the class itself."""
    itself = replace(EXPLAINED, invisible=ITSELF)
    rows = {
        "a": make_row(EXPLAINED, "point_mass"),
        "b": make_row(EXPLAINED, "crack", accepted=False),
        "c": make_row(itself, "sag"),
        "d": make_row(itself, "sag", "point_mass"),
        "e": make_row(EXPLAINED),
    }
    truths = {name: row.truth for name, row in rows.items()}
    answers = {name: row.answer for name, row in rows.items()}
    assert list(blind_trial.hangers_to_repeat(truths, answers)) == ["a"]


@pytest.mark.parametrize(
    ("row", "right", "false_cause"),
    [
        (make_row(EXPLAINED, "point_mass"), True, False),
        (make_row(EXPLAINED, "point_mass", "timebase"), True, False),
        (make_row(EXPLAINED, "timebase"), False, True),
        (make_row(EXPLAINED, "timebase", inherent=("point_mass",)), True, False),
        (make_row(PAIR, "timebase", inherent=("point_mass",)), False, True),
        (make_row(PAIR, "timebase", inherent=("point_mass", "sag")), True, False),
        (make_row(EXPLAINED, "point_mass", without=("point_mass",)), False, True),
        (make_row(EXPLAINED), False, True),
        (make_row(EXPLAINED, "crack", accepted=False), False, True),
        (make_row(NO_GAP), True, False),
        (make_row(NO_GAP, "point_mass"), False, False),
        (make_row(None, "point_mass"), False, False),
        (make_row(UNKNOWN, "crack", accepted=False), True, False),
        (make_row(UNKNOWN, "point_mass", without=("point_mass",)), True, False),
        (make_row(UNKNOWN, "point_mass"), False, False),
        (make_row(UNKNOWN), False, False),
        (make_row(replace(EXPLAINED, causes=ALIKE), "temperature_tension"), True, False),
        (make_row(replace(NO_GAP, invisible=ITSELF), "sag"), True, False),
    ],
)
def test_is_right(row: Row, right: bool, false_cause: bool) -> None:
    assert (row.is_right, row.is_false_cause) == (right, false_cause)


def test_names_of_a_group_and_of_a_cause_of_the_class() -> None:
    row = make_row(replace(EXPLAINED, causes=ALIKE), "temperature_tension")
    assert row.first == {"point_mass"}
    assert row.named == {"point_mass", "temperature_tension"}
    assert make_row(replace(NO_GAP, invisible=ITSELF), "sag").in_class


def test_score_counts() -> None:
    rows = [
        make_row(SURE, "point_mass"),
        make_row(SURE, "timebase"),
        make_row(NO_GAP),
        make_row(SURE),
        make_row(SURE, "timebase", without=("timebase",)),
        make_row(None, "timebase"),
    ]
    found = {mark.what: mark for mark in score(rows)}
    for what, reached in {
        "refused": "1 of 6",
        "gap claimed on sound hangers": "1 of 2",
        "cause named first": "1 of 2",
        "sure (> 0.8) and wrong": "2 of 4",
        "sure and wrong, true cause left out": "1 of 1",
        "cause stated with 0.9 or more: right": "1 of 3",
        "95 % interval of the tension holds": "5 of 5: 1.00 (0.55",
        "error of the tension, median, before -> after": "1.0% -> 1.0%",
    }.items():
        assert found[what].reached.startswith(reached), what
    assert found["gap claimed on sound hangers"].is_met is False
    assert found["answers that contradict themselves"].is_met is True
    assert len(found) == len(score(rows))


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (EXPLAINED, ""),
        (NO_GAP, ""),
        (replace(EXPLAINED, unexplained_probability=0.1), "add to"),
        (replace(EXPLAINED, remarks=("The sampler failed for sag: 8 draws.",)), "sampler"),
        (replace(EXPLAINED, remarks=("Doubtful: test t1. Of another hanger.",)), ""),
        (replace(EXPLAINED, tension_after_n=replace(TENSION, q975=101.5)), "its mean"),
        (replace(NO_GAP, no_gap_probability=0.92, causes=(), unexplained_probability=0.08), ""),
        (
            replace(NO_GAP, tension_after_n=TensionEstimate(120, 1, 118, 122, 117, 123)),
            "another tension",
        ),
    ],
)
def test_find_contradictions(found: Diagnosis, said: str) -> None:
    contradictions = find_contradictions(found)
    assert bool(contradictions) == bool(said)
    assert all(said in each for each in contradictions)
