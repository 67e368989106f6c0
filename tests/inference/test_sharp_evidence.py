"""Compare the evidence from sharp frequencies with quadrature: thin ridges, long tails."""

from __future__ import annotations

import numpy as np
import pytest

from shm.inference import UpdateOptions, update
from shm.models import THESIS, build
from shm.values import Posterior
from tests.helpers.given_modes import with_modes
from tests.helpers.hangers import HANGER_3
from tests.helpers.sharp_oracle import ORACLE, Resolution, SharpEvidence, sharp_test
from tests.helpers.slow import few_of

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


def updated(repeat: int, seed: int) -> Posterior:
    tests = [sharp_test()] * repeat
    return update(tests, build("beam2", HANGER_3, THESIS), UpdateOptions(1000, seed=seed))


def test_the_evidence_of_data_counted_ten_times_is_that_of_quadrature() -> None:
    posterior = updated(10, seed=11)
    assert abs(posterior.log_evidence - ORACLE[10]) < 4 * posterior.log_evidence_sd
    assert posterior.log_evidence_sd < 0.1


SOFT_BELOW = (1.364, 0.986, 6.123, 6.050, 8.440, 8.739)


@pytest.mark.parametrize(
    ("theta", "sd"),
    few_of([((1.708, 1.0, 7.336, 8.790, 7.007, 6.708), 1e-4), (SOFT_BELOW, 1e-5)], 1),
)
def test_the_tension_of_a_needle_is_found(theta: tuple[float, ...], sd: float) -> None:
    """Measure orders 2 to 6 of the exact beam to a fraction `sd`: a narrow, bent valley."""
    model, rng = build("beam2", HANGER_3, THESIS), np.random.default_rng(81)
    exact = model.frequencies_hz(np.array([theta]), 6)[0, :, 1:]
    test = with_modes(exact, sd, sd * rng.standard_normal(exact.shape), first_order=2)
    found = update([test], model, UpdateOptions(1000, seed=2))
    low, high = np.quantile(found.parameter("theta_F"), [0.005, 0.995])
    assert found.effective_sample_size > 200
    assert low < theta[0] < high
    assert high - low < 0.06
