"""How probable a class with clamped ends is before any data, beside one with springs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.assumptions import DEFAULTS
from shm.inference.updating import _log_prior
from shm.models import THESIS, build
from shm.values import Hanger, Mode
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import a_test

ROUND = replace(HANGER_3, plate=None)
ONE = 1 / (1 + DEFAULTS.end_restraint.decades)
"""A rigid end stands for the decade beyond the stiffest: one of so many and one more."""


@pytest.mark.parametrize(
    ("hanger", "planes", "shares"),
    [
        (ROUND, 1, [ONE**2, ONE, ONE, 0.5]),
        (HANGER_3, 1, [ONE**2, ONE, ONE, 0.5]),
        (HANGER_3, 2, [ONE**4, ONE, ONE**2, 0.5]),
        (ROUND, 2, [ONE**4, ONE, ONE**2, 0.5, ONE**2, ONE]),
    ],
)
def test_a_rigid_end_is_as_probable_as_any_decade(
    hanger: Hanger, planes: int, shares: list[float]
) -> None:
    modes = (Mode("transverse", 1, 5.8), Mode("longitudinal", 1, 5.9))[:planes]
    found = _log_prior(build("beam1", hanger), [a_test(modes=modes), a_test(modes=modes[:1])])
    assert found == pytest.approx(np.log(np.mean(shares)), rel=1e-12)


def test_a_class_with_springs_and_the_priors_of_the_thesis_have_no_such_share() -> None:
    assert _log_prior(build("beam2", ROUND), [a_test()]) == 0.0
    assert _log_prior(build("beam1", ROUND, THESIS), [a_test()]) == 0.0
