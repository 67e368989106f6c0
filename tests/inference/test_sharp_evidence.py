"""The evidence from sharp frequencies against quadrature: thin ridges, long tails, four copies."""

from __future__ import annotations

import pytest

from shm.inference import UpdateOptions, update
from shm.models import THESIS, build
from tests.helpers.hangers import HANGER_3
from tests.helpers.sharp_oracle import ORACLE, Resolution, SharpEvidence, sharp_test

COARSE = Resolution(step=0.5, change=10.0)


@pytest.mark.trial
@pytest.mark.parametrize("repeat", ORACLE)
def test_a_coarser_quadrature_agrees_with_the_stored_oracle(repeat: int) -> None:
    coarse = SharpEvidence(repeat, COARSE).log_evidence()
    assert coarse == pytest.approx(ORACLE[repeat], abs=0.03)


def test_the_cells_of_the_springs_are_fine_enough() -> None:
    near_peak = (1.3678, 0.98655)
    found = SharpEvidence(10).log_density(*near_peak)
    finer = SharpEvidence(10, Resolution(nodes=6, change=4.0)).log_density(*near_peak)
    assert found == pytest.approx(finer, abs=2e-3)


@pytest.mark.parametrize("repeat", ORACLE)
def test_the_evidence_is_that_of_quadrature(repeat: int) -> None:
    options = UpdateOptions(1000, seed=11, repeat=repeat)
    posterior = update([sharp_test()], build("beam2", HANGER_3, THESIS), options)
    assert abs(posterior.log_evidence - ORACLE[repeat]) < 4 * posterior.log_evidence_sd
    assert posterior.log_evidence_sd < 0.1
