from __future__ import annotations

import numpy as np
import pytest

from shm.identify.measuring.frf import HitRecord
from shm.identify.measuring.hits import find_pulses
from shm.identify.measuring.setups import LEAD_SECONDS, cut
from tests.identify.signals import Planted, Sensor, recording

RATE_HZ = 1024.0
MODE = Planted(13.5, 0.004, (1.0,))


def _hits(**changes: float) -> list[HitRecord]:
    keywords = {"hits": 2, "seconds": 4.0, "rate_hz": RATE_HZ, **changes}
    record = recording([MODE], (Sensor(),), **keywords)  # type: ignore[arg-type]
    force = record.channels[0].values
    signals = np.array([channel.values for channel in record.accelerations])
    return [HitRecord(force, signals, pulse) for pulse in find_pulses(force, RATE_HZ)]


def _impulse(hit: HitRecord) -> float:
    return float(np.sum(hit.force[hit.pulse.start : hit.pulse.end])) / RATE_HZ


@pytest.mark.parametrize("hit", _hits())
def test_the_force_keeps_its_impulse_and_its_place(hit: HitRecord) -> None:
    found = cut(hit, RATE_HZ, 50.0)
    assert found.sampling_rate_hz == 128.0
    assert np.sum(found.driven[0]) / 128.0 == pytest.approx(_impulse(hit), rel=0.005)
    lead = LEAD_SECONDS + 16 / 128.0 + (hit.pulse.peak - hit.pulse.start) / RATE_HZ
    assert np.argmax(found.driven[0]) / 128.0 == pytest.approx(lead, abs=1 / 128.0)


def test_free_motion_is_the_same_exponential_as_before_the_filter() -> None:
    """A step of k samples multiplies the analytic signal of one mode by exp(s k / rate)."""
    decay = cut(_hits()[0], RATE_HZ, 50.0).decay[0]
    omega = 2 * np.pi * MODE.frequency_hz
    pole = omega * (-MODE.damping_ratio + 1j * np.sqrt(1 - MODE.damping_ratio**2))
    step = np.exp(pole / 128.0)
    rest = decay[2:] - 2 * step.real * decay[1:-1] + abs(step) ** 2 * decay[:-2]
    # The mean that is taken off is not zero: a constant remains.
    assert np.ptp(rest) < 1e-3 * np.ptp(decay)


def test_all_hits_have_the_same_lead_even_where_the_record_begins_with_the_hit() -> None:
    def peak_of(hit: HitRecord) -> int:
        return int(np.argmax(cut(hit, RATE_HZ, 50.0).driven[0]))

    early = _hits(lead_s=0.002)
    assert {peak_of(hit) for hit in early + _hits()} <= {
        peak_of(early[0]),
        peak_of(early[0]) + 1,
    }
