"""What trials taught: the data file, its loader, and the command that writes it agree."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest

from shm.errors import BadInput
from shm.gap.contract import Hypothesis
from shm.gap.fit import baseline_fit, fitted
from shm.gap.model_probabilities import CALIBRATION, FILE, Calibration, Provenance, read_calibration
from shm.models.effects import EFFECTS, Variant
from tests.benchmarks.blind.making import make_trial
from tests.benchmarks.gap_calibration import (
    Lesson,
    Ways,
    calibrated,
    lesson,
    minor,
    shares,
    text,
    ways_of,
)
from tests.helpers.gap_campaigns import campaign, problem_of

ABOUT = Provenance("toy", "1", "2", "", date(2026, 11, 25), "none")


def test_the_file_is_what_the_command_would_write_of_its_values() -> None:
    assert FILE.read_text(encoding="utf-8") == text(CALIBRATION)


def test_shares_add_to_one() -> None:
    laws = [*CALIBRATION.of_a_mode.values(), *CALIBRATION.on_the_whole.values(), CALIBRATION.exact]
    for each in zip(*laws, strict=True):
        assert sum(each) == pytest.approx(1.0)
    assert sum(CALIBRATION.where_rough.values()) == pytest.approx(1.0)


def test_a_file_that_lacks_a_value_is_refused(tmp_path: Path) -> None:
    for spoilt in (text(CALIBRATION).replace("law_odds", "odds"), "share ="):
        (tmp_path / "calibration.toml").write_text(spoilt)
        with pytest.raises(BadInput, match="not a whole calibration"):
            read_calibration(tmp_path / "calibration.toml")


def test_what_few_answers_speak_for_stays() -> None:
    found = calibrated([Lesson("c1", 1, mimics=2, pair=("sag", "timebase"))], ABOUT)
    assert replace(found, provenance=CALIBRATION.provenance) == CALIBRATION


def test_counts_become_shares() -> None:
    """Ten left out: five do what one effect does, three what two do, and these name their pair."""
    pair, turned = ("sag", "timebase"), ("stiff_end_zones", "sensor_misalignment")
    lessons = [Lesson(f"c{i}", 1, mimics=1 if i < 5 else 0, undetected=i == 0) for i in range(7)]
    lessons += [Lesson("p", 1, mimics=2, undetected=False, pair=pair)] * 8
    lessons += [Lesson("t", 1, mimics=2, undetected=False, pair=turned)] * 5
    found = calibrated(lessons, ABOUT)
    assert (found.mimics_one, found.mimics_two) == (5 / 20, 13 / 20)
    assert found.undetected_share == 1 / 20
    assert found.in_mimicking_pairs == {"sag": 8, "timebase": 8}
    assert found.with_turned_sensors == {"stiff_end_zones": 5}
    assert found.mimicking_pairs == 13


def test_a_second_cause_is_minor_below_the_share_that_divides_best() -> None:
    below, odds = minor([(0.01 * i, False) for i in range(8)] + [(0.12, True), (0.2, True)])
    assert below == pytest.approx((0.07 + 0.12) / 2)
    assert odds == 5.0  # eight to none, two added on either side


def test_shares_of_ways_are_those_by_which_they_were_drawn() -> None:
    """400 laws, each seen well: 0.6 exact, and of the half that may be rough 0.3 are."""
    rng, ways = np.random.default_rng(1), ["exact 0", "mode 0.1", "rough 0.1", "rough 0.4"]
    cases: list[Ways] = []
    for level in (False, True):
        share = [0.6, 0.4, 0.0, 0.0] if not level else [0.42, 0.28, 0.2, 0.1]
        for true in rng.choice(4, size=200, p=share):
            logs = {way: -8.0 * abs(i - true) for i, way in enumerate(ways)}
            cases.append({w: log for w, log in logs.items() if level or not w.startswith("rough")})
    found = shares(cases)
    assert found["exact 0"] + found["mode 0.1"] == pytest.approx(1.0)
    assert found["exact 0"] == pytest.approx(0.6, abs=0.06)
    assert found["rough"] == pytest.approx(0.3, abs=0.08)
    assert found["rough 0.1"] == pytest.approx(2 / 3, abs=0.15)


def test_what_lessons_teach_reads_back_as_it_was_written(tmp_path: Path) -> None:
    """Of the laws of a real fit, by the names that a case gives them."""
    stiffer = Hypothesis((("bending_stiffness", Variant()),))
    problem, rng = problem_of(campaign(stiffer.effects, [0.25])), np.random.default_rng(1)
    baseline = fit_alone(problem, rng)
    own = ways_of(problem, baseline, fitted(problem, stiffer, rng))
    pair = ("sag", "timebase")
    lessons = [
        Lesson(f"c{k}", 1 + k % 2, own, 0.1 * (k % 3), k % 2 == 0, k % 3, pair, own)
        for k in range(12)
    ]
    read = _read_back(lessons, tmp_path)
    assert read.in_mimicking_pairs == {"sag": 12, "timebase": 12}
    assert (read.mimics_one, read.undetected_share) == (pytest.approx(1 / 3, rel=1e-3), 0.5)
    assert read.exact.own != CALIBRATION.exact.own


def _read_back(lessons: list[Lesson], folder: Path) -> Calibration:
    found = calibrated(lessons, ABOUT)
    (folder / "calibration.toml").write_text(text(found))
    read = read_calibration(folder / "calibration.toml")
    assert text(read) == text(found)
    return read


@pytest.mark.trial
def test_a_trial_teaches_what_the_file_holds(tmp_path: Path) -> None:
    """Two cases, each taken for ten: the file written of them reads back as it was."""
    made = make_trial(tmp_path / "trial", 2, seed=7)
    lessons = [lesson(tmp_path / "trial" / "cases" / each.case, each) for each in made]
    assert any(each.own for each in lessons)
    read = _read_back(lessons * 10, tmp_path)
    assert set(read.in_mimicking_pairs) <= set(EFFECTS)
    assert sum(each.own for each in read.of_a_mode.values()) < 1
