"""What trials taught: the data file, its loader, and the command that writes it agree."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from shm.gap.causes.probabilities import CALIBRATION, FILE, Calibration, read_calibration
from shm.gap.causes.search import fit_alone
from shm.gap.hypotheses.contract import Hypothesis
from shm.models.effects import Variant
from tests.benchmarks.blind_trial import GAPPED, Plan, make_hanger
from tests.benchmarks.gap_calibration import Lesson, calibrated, lesson, shares, text, ways_of
from tests.helpers.gap_campaigns import campaign, fit_of, problem_of

ABOUT = tomllib.loads(FILE.read_text(encoding="utf-8"))["provenance"]
FRACTIONS = len(CALIBRATION.off_by)


def test_file_is_what_the_command_writes() -> None:
    assert FILE.read_text(encoding="utf-8") == text(CALIBRATION, ABOUT)


def test_shares_of_laws_add_to_one() -> None:
    for each in zip(CALIBRATION.exact, *CALIBRATION.off_by.values(), strict=True):
        assert sum(each) == pytest.approx(1.0)
    assert CALIBRATION.mimics_one + CALIBRATION.mimics_two < 1


def test_calibrated_few_answers_change_nothing() -> None:
    assert calibrated([Lesson("c1", mimics=2)])[0] == CALIBRATION


def test_calibrated_counts_become_shares() -> None:
    lessons = [Lesson(f"c{i}", mimics=(1, 1, 1, 2, 0)[i % 5]) for i in range(20)]
    found, _ = calibrated(lessons)
    assert (found.mimics_one, found.mimics_two) == (12 / 20, 4 / 20)
    assert found.off_by == CALIBRATION.off_by


def test_shares_are_those_drawn() -> None:
    """400 laws, each seen well: 0.6 exact, the others off by the third and the last fraction."""
    true = np.random.default_rng(1).choice(4, size=400, p=[0.6, 0.0, 0.3, 0.1])
    found = shares([tuple(-8.0 * abs(i - t) for i in range(4)) for t in true])
    assert sum(found) == pytest.approx(1.0)
    assert found == pytest.approx([0.6, 0.0, 0.3, 0.1], abs=0.06)


def test_calibrated_reads_back(tmp_path: Path) -> None:
    """Of the laws of a real fit: an exact one speaks for an exact law."""
    stiffer = Hypothesis((("bending_stiffness", Variant()),))
    problem = problem_of(campaign(stiffer.effects, [0.25]))
    fit = fit_of(problem, stiffer)
    own = ways_of(problem, fit_alone(problem, np.random.default_rng(1)), fit)
    assert len(own) == 1 + FRACTIONS
    assert own[0] > own[-1]
    lessons = [Lesson(f"c{k}", own, k % 3, own) for k in range(12)]
    read = _read_back(lessons, tmp_path)
    assert read.mimics_one == pytest.approx(1 / 3, rel=1e-3)
    assert read.exact.known == read.exact.unknown != CALIBRATION.exact.known


def _read_back(lessons: list[Lesson], folder: Path) -> Calibration:
    found, _ = calibrated(lessons)
    (folder / "calibration.toml").write_text(text(found, ABOUT))
    read = read_calibration(folder / "calibration.toml")
    assert text(read, ABOUT) == text(found, ABOUT)
    return read


@pytest.mark.trial
def test_a_hanger_teaches_what_the_file_holds(tmp_path: Path) -> None:
    """One hanger with a cause, taken for ten: the file written of it reads back."""
    plan = Plan("h001", GAPPED, 0, ("mass all along",))
    taught = lesson(tmp_path, make_hanger(plan, 7, tmp_path))
    assert taught.mimicking
    read = _read_back([taught] * 10, tmp_path)
    assert (read.mimics_one, read.mimics_two) == (taught.mimics == 1, taught.mimics == 2)
