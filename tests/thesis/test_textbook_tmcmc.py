"""The thesis's own sampler, against quadrature and against ours."""

from __future__ import annotations

import numpy as np
import pytest

from shm.errors import UsageError
from shm.inference import UpdateOptions, update
from shm.models import THESIS, build
from tests.benchmarks.thesis.textbook_tmcmc import update_textbook
from tests.helpers.evidence_oracle import ORACLE, TABLES, modal_test
from tests.helpers.hangers import HANGER_3


def test_textbook_evidence_is_too_low_on_hangers() -> None:
    """On beam1, where the likelihood is broad, it comes close."""
    tests, model = [modal_test(TABLES["1.1"])], build("beam1", HANGER_3, THESIS)
    posterior = update_textbook(tests, model, UpdateOptions(1000, 1))
    assert posterior.samples.shape == (1000, 3)
    assert posterior.method == "textbook"
    assert posterior.log_evidence == pytest.approx(ORACLE["1.1", "beam1", 1], abs=6)
    assert posterior.tension_n.mean() / 711e3 == pytest.approx(1.13, abs=0.1)
    assert 1 <= posterior.effective_sample_size <= 1000


def test_textbook_refuses_priors_of_a_description() -> None:
    """It would take the field's noise for a uniform model error, and say nothing."""
    with pytest.raises(UsageError, match="the textbook's sampler draws the model error"):
        update_textbook([modal_test(TABLES["1.1"])], build("beam1", HANGER_3))


def test_textbook_evidence_is_right_where_nothing_changes_phase() -> None:
    """One frequency of unknown model error: a broad likelihood that any path follows."""
    tests, model = [modal_test({"transverse": [5.8]})], build("beam1", HANGER_3, THESIS)
    found = [
        update_textbook(tests, model, UpdateOptions(2000, seed)).log_evidence for seed in range(3)
    ]
    exact = update(tests, model, UpdateOptions(2000)).log_evidence
    assert np.mean(found) == pytest.approx(exact, abs=0.3)
