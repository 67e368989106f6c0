"""What of an effect can be seen, where its prior is cut, and where to climb from."""

from __future__ import annotations

import numpy as np
import pytest

from shm.gap.contract import Hypothesis
from shm.gap.scan import VISIBLE, Scan
from shm.gap.search import fit_alone
from shm.models.effects import Variant
from tests.helpers.gap_campaigns import campaign, fit_of, problem_of, scan_of

STIFFER = Hypothesis((("bending_stiffness", Variant()),))
HEAVIER = Hypothesis((("distributed_mass", Variant()),))
CLAMP = Hypothesis((("point_mass", Variant()),))


@pytest.mark.parametrize(
    ("least", "growth", "smallest"),
    [
        (0.05, 1000.0, np.log(VISIBLE / 0.05) / np.log(1000)),
        (0.1, 1.0, 1.0),
        (9.0, 1.0, 0.0),
    ],
)
def test_smallest_by_what_is_visible(least: float, growth: float, smallest: float) -> None:
    """What grows a thousandfold over the prior is seen from the size where it is VISIBLE on."""
    magnitude = np.random.default_rng(1).permutation(np.linspace(0, 1, 801))
    visible, none = least * growth**magnitude, np.zeros((801, 1))
    made = Scan(STIFFER, none, none, magnitude, visible, np.zeros(801), none)
    assert made.smallest == pytest.approx(smallest, abs=1e-3)
    assert made.seen.any()


@pytest.mark.parametrize(
    ("hypothesis", "values"), [(HEAVIER, [0.06]), (STIFFER, [0.1]), (CLAMP, [5.0, 3.1])]
)
def test_scan_evidence_near_fit(hypothesis: Hypothesis, values: list[float]) -> None:
    problem = problem_of(campaign(hypothesis.effects, values))
    before, found = fit_alone(problem, np.random.default_rng(1)), scan_of(problem, hypothesis)
    fit = fit_of(problem, hypothesis)
    gained = fit.log_evidence - before.log_evidence
    assert found.log_evidence - before.log_evidence == pytest.approx(gained, abs=3 + 0.5 * gained)
    starts = found.starts(problem, before)
    assert starts.shape[1] == len(fit.z)
    own = slice(len(before.z), None)
    assert np.abs(starts[:, own] - fit.z[own]).max(axis=1).min() < 1.0
