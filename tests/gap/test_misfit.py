"""Tests that no explanation comes near are refused, with what each says of the description."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import BadInput
from shm.gap import GapOptions, diagnose
from shm.models.hanger import PhysicalHanger, solve
from shm.values import ModalTest, Mode
from tests.helpers.effects import all_but
from tests.helpers.hangers import HANGER_3

OPTIONS = GapOptions("beam1", without=all_but("point_mass", "timebase"), seed=1)
AREA_M2 = np.pi * 0.0004**2 / 4
STRING = replace(
    HANGER_3,
    id=1,
    length_m=0.65,
    area_m2=AREA_M2,
    second_moment_m4=AREA_M2**2 / (4 * np.pi),
    mass_per_length_kg_m=7850 * AREA_M2,
    nominal_tension_n=15.0,
    plate=None,
)


def clamped(name: str, tension_n: float, factor: float = 1.0) -> ModalTest:
    bar = PhysicalHanger.clamped(HANGER_3, np.array([tension_n]))
    frequency_hz = factor * solve(bar, 6, np.empty(0), shapes=False).frequency_hz[0, 0]
    modes = [
        Mode("transverse", k, float(f), 1e-3 * float(f)) for k, f in enumerate(frequency_hz, 1)
    ]
    return ModalTest(name, tuple(modes))


@pytest.mark.slow
def test_tests_of_two_hangers_under_one_number_are_refused() -> None:
    """The second half of the tests is 1.5 times as high in every mode."""
    tests = [clamped(f"own_{k}", 711e3) for k in range(3)]
    tests += [clamped(f"foreign_{k}", 711e3, 1.5) for k in range(3)]
    with pytest.raises(BadInput) as refused:
        diagnose(tests, HANGER_3, OPTIONS)
    text = str(refused.value)
    assert "no explanation fits the frequencies of hanger 3" in text
    assert "test own_" in text
    assert "test foreign_" in text
    assert "all tests are of this hanger" in refused.value.remedy


def test_a_nominal_tension_off_by_thirty_times_is_named() -> None:
    speed_m_s = np.sqrt(30 * STRING.nominal_tension_n / STRING.mass_per_length_kg_m)
    modes = [Mode("transverse", k, k * float(speed_m_s) / (2 * 0.65), 0.5) for k in range(1, 5)]
    with pytest.raises(BadInput, match="carries 450 N, 30 times the nominal tension"):
        diagnose([ModalTest("t1", tuple(modes))], STRING, OPTIONS)


def test_a_string_slack_in_one_test_is_fitted_at_the_tension_of_both() -> None:
    """A tension far from that of both tests predicts neither: a scan finds where to start."""
    string = [
        ModalTest(
            name,
            tuple(Mode("transverse", k, f, 0.5) for k, f in enumerate(hz, 1)),
            tension_read_n=read_n,
            tension_read_sd_n=0.1,
        )
        for name, hz, read_n in (("taut", (121.8, 241.7), 24.0), ("slack", (18.5, 37.2), 0.3))
    ]
    found = diagnose(string, STRING, OPTIONS)
    assert found.leads == "no gap"
    assert found.shrinkage.rms_before_percent < 2.0
    assert found.tension_before_n.mean == pytest.approx((24.0 + 0.3) / 2, rel=0.02)
