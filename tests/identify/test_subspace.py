from __future__ import annotations

import logging
import subprocess
import sys

import numpy as np
import pytest

from shm.identify.estimation.poles import collinearity, poles_of, real_shape
from shm.identify.estimation.ssi import _pyoma2, hankel, realise

RATE_HZ = 256.0


def _decay(frequency_hz: float = 20.0, damping_ratio: float = 0.004) -> np.ndarray:
    omega = 2 * np.pi * frequency_hz
    pole = -damping_ratio * omega + 1j * omega * np.sqrt(1 - damping_ratio**2)
    motion = np.exp(pole * np.arange(1500) / RATE_HZ)
    return np.vstack([motion.real, 0.4 * motion.real, -0.7 * motion.real])


def test_pyoma2_is_kept_quiet() -> None:
    """No log handler, no numpy warning turned off, no word on either stream, no heavy import."""
    script = (
        "import logging, sys, numpy as np; before = np.geterr();"
        "import shm.identify.estimation.ssi as s;"
        "h = s.hankel(np.random.default_rng(0).normal(size=(2, 400)), np.ones((1, 400)), 20);"
        "s.realise(h, 20, 8);"
        "assert np.geterr() == before; assert not logging.getLogger('pyoma2').handlers;"
        "assert logging.getLogger('matplotlib').level == 0;"
        "assert not {'pandas', 'sklearn', 'matplotlib'} & set(sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_its_log_records_below_a_warning_go_nowhere(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        hankel(_decay(), _decay(), 10)
    assert not caplog.records


def test_the_hankel_matrix_of_one_decay_has_rank_two() -> None:
    decay = _decay()
    matrix = hankel(decay, decay[:1], 30)
    assert matrix.shape == (90, 30)
    assert np.linalg.matrix_rank(matrix, tol=1e-8 * np.linalg.norm(matrix)) == 2


def test_it_is_that_of_pyoma2() -> None:
    """Of noise, and of a decay whose last part is a thousandth of its first."""
    noise = np.random.default_rng(1).normal(size=(3, 700))
    for signals in (noise, noise * np.exp(-np.arange(700) / 100)):
        theirs, _ = _pyoma2().build_hank(signals, signals[:2], 40, "cov")
        ours = hankel(signals, signals[:2], 40) / signals.shape[1]
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-14 * np.abs(theirs).max())


def test_it_is_a_sum_over_time_so_that_long_decays_weigh_more() -> None:
    decay = np.ones((1, 200))
    assert hankel(decay, decay, 5) == pytest.approx(200 * np.ones((5, 5)))


def test_a_realisation_returns_the_pole_and_the_shape_that_made_the_decay() -> None:
    decay = _decay(20.0, 0.004)
    _, states, outputs = realise(hankel(decay, decay, 30), 30, 2)
    poles = poles_of(states[1], outputs[1], RATE_HZ)
    assert poles.frequency_hz == pytest.approx([20.0], rel=1e-9)
    assert poles.damping_ratio == pytest.approx([0.004], rel=1e-6)
    np.testing.assert_allclose(real_shape(poles.shapes[:, 0]), [1.0, 0.4, -0.7], atol=1e-9)


def test_a_shape_is_collinear_where_all_its_phases_agree() -> None:
    shape = np.array([1.0, -0.5, 0.2])
    assert collinearity(shape * np.exp(0.7j)) == pytest.approx(1.0)
    assert collinearity(np.array([1.0, 1.0j])) == pytest.approx(0.0, abs=1e-12)
    assert collinearity(np.zeros(2, complex)) == 0.0


def test_a_real_shape_does_not_depend_on_the_phase_it_came_with() -> None:
    shape = np.array([0.3, -1.2, 0.6])
    for phase in np.linspace(0, 6, 7):
        np.testing.assert_allclose(real_shape(shape * np.exp(1j * phase)), shape / -1.2, atol=1e-12)
