"""What comes of pyOMA2, and that nothing else of it gets through its door."""

from __future__ import annotations

import logging
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from pyoma2.functions import ssi

from shm.errors import UsageError
from shm.identify import IDENTIFIERS, IdentifyOptions, identify
from shm.identify.contract import FREQUENCY_FLOOR, Measurement
from shm.identify.estimation.pyoma import poles_of_orders
from shm.identify.measuring.setups import measure_recordings
from shm.values import Hanger, Recording
from tests.identify.signals import Planted, Sensor, recording

OPTIONS = IdentifyOptions(2.0, 50.0)
HZ = (6.0, 13.5, 23.0)
SHAPES = ((1.0, 0.4, -0.3), (0.6, 1.0, 0.5), (-0.4, 0.8, 1.0))
ALONE = {
    "the command": "from shm_cli.main import run; run(['--help'])",
    "the front": "import shm; shm.identify",
}


def _record(noise: float = 0.02) -> Recording:
    planted = [Planted(f, 0.003, shape) for f, shape in zip(HZ, SHAPES, strict=True)]
    sensors = tuple(Sensor("transverse", x_m) for x_m in (2.0, 3.0, 4.0))
    return recording(planted, sensors, noise=noise, hits=3)


def _measurement() -> Measurement:
    return measure_recordings([_record()], OPTIONS)[0]


def test_orders_that_are_not_asked_for_change_nothing_and_each_has_pyoma2s_poles() -> None:
    """What SSI_poles makes of all orders and of the whole observability matrix is the reference."""
    rng = np.random.default_rng(1)
    hankel = rng.standard_normal((60, 20))
    some = poles_of_orders(hankel, 20, [8, 12], 100.0, shift_hz=5.0)
    every = poles_of_orders(hankel, 20, [4, 8, 12], 100.0, shift_hz=5.0)
    observability, states, outputs, _ = ssi.SSI_fast(hankel, 20, 12, step=4)
    hz, _, shapes, rates, *_ = ssi.SSI_poles(
        observability, states, outputs, 12, 0.01, step=4, HC=False
    )
    for poles, again in zip(some, every[1:], strict=True):
        np.testing.assert_array_equal(poles.frequency_hz, again.frequency_hz)
        own = rates[: poles.order, poles.order // 4]
        above = (own.imag > 0) & (own.imag < 0.999 * np.pi * 100.0)
        assert poles.frequency_hz == pytest.approx(np.abs(own[above] + 10j * np.pi) / (2 * np.pi))
        np.testing.assert_allclose(poles.shapes.T, shapes[: len(own), poles.order // 4][above])
        assert poles.dropped[0].count == poles.order - 2 * above.sum()
        assert hz.shape[1] == 4


def test_its_own_identification_finds_modes_apart() -> None:
    found = IDENTIFIERS["pyoma2"](_measurement(), OPTIONS)
    assert [mode.frequency_hz for mode in found.modes] == pytest.approx(HZ, rel=2e-3)
    assert [mode.damping_ratio for mode in found.modes] == pytest.approx([0.003] * 3, rel=0.5)
    assert found.modes[1].shape == pytest.approx(SHAPES[1], abs=0.02)
    for mode in found.modes:
        assert mode.frequency_sd_hz >= FREQUENCY_FLOOR * mode.frequency_hz
        assert np.isnan(mode.damping_sd)
    assert found.poles.stable.any()


def test_silence_holds_no_mode() -> None:
    silent = replace(_measurement(), decays=(np.zeros((3, 500)),))
    assert IDENTIFIERS["pyoma2"](silent, OPTIONS).modes == ()


def test_nothing_of_it_gets_through_the_door(capfd: pytest.CaptureFixture[str]) -> None:
    state, handlers = np.geterr(), list(logging.getLogger("pyoma2").handlers)
    level = logging.getLogger("matplotlib").level
    for name in IDENTIFIERS:
        IDENTIFIERS[name](_measurement(), OPTIONS)
    assert np.geterr() == state
    assert logging.getLogger("pyoma2").handlers == handlers
    assert logging.getLogger("matplotlib").level == level
    assert capfd.readouterr() == ("", "")


def test_a_process_that_begins_with_identify_keeps_its_state_and_its_log() -> None:
    code = (
        "import logging, numpy as np; before = np.geterr()\n"
        "from shm.identify.estimation.pyoma import poles_of_orders\n"
        "poles_of_orders(np.random.default_rng(1).standard_normal((60, 20)), 20, [4], 1.0)\n"
        "assert np.geterr() == before\n"
        "assert not logging.getLogger('pyoma2').handlers\n"
        "assert logging.getLogger('matplotlib').level == 0\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")


@pytest.mark.parametrize("code", ALONE.values(), ids=ALONE.keys())
def test_it_is_not_imported_before_it_is_needed(code: str) -> None:
    asked = f"{code}\nimport sys; sys.exit('pyoma2' in sys.modules)"
    ended = subprocess.run([sys.executable, "-c", asked], capture_output=True, check=False)
    assert ended.returncode == 0


@pytest.mark.parametrize(
    ("identifier", "hanger", "is_checked"),
    [
        ("ssi", None, False),
        ("pyoma2", None, True),
        ("ssi", Hanger.without_model(1), True),
    ],
)
def test_a_second_opinion_is_asked_where_no_bar_speaks_for_the_modes(
    identifier: str, hanger: Hanger | None, is_checked: bool
) -> None:
    options = replace(OPTIONS, identifier=identifier, cross_check="auto")
    found = identify([_record()], options, test_id="t", hanger=hanger)
    checks = [check for check in found.quality if check.name == "cross-check"]
    assert bool(checks) is is_checked
    assert all(check.verdict == "good" and "3 modes in common" in check.found for check in checks)


def test_an_identifier_that_is_gone_is_a_usage_error_that_names_the_others() -> None:
    with pytest.raises(UsageError, match="frf") as refused:
        identify([recording([Planted(6.0, 0.003, (1.0, 0.2))])], replace(OPTIONS, identifier="frf"),
                 test_id="t")  # fmt: skip
    assert "pyoma2" in str(refused.value.remedy)
