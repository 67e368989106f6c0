"""Cuts what belongs to one hit out of its record, low-passed and thinned to the band."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.identify.measuring.bandlimit import band_limited, filter_reach
from shm.identify.measuring.hits import RINGING_SAMPLES, HitRecord
from shm.values import FloatArray

LEAD_SECONDS = 0.02
"""The force's pulse, smeared by the filter, begins at least so long after a cut's first sample."""


@dataclass(frozen=True, eq=False)
class Cut:
    """One hit: `driven` (1 + points, samples), force first, at `sampling_rate_hz`.

    From column `free` on, the filter saw nothing of the force: there the hanger rings freely. The
    first column lies equally long before the hit in all hits of one sampling rate.
    """

    driven: FloatArray
    free: int
    sampling_rate_hz: float

    @property
    def decay(self) -> FloatArray:
        """The free motion, (points, samples)."""
        return self.driven[1:, self.free :]


def cut(hit: HitRecord, sampling_rate_hz: float, band_high_hz: float) -> Cut:
    """The hit and its ring-down; force and accelerations pass the same filter.

    Where the record begins too late, the hanger is taken to have been at rest before.
    """
    reach, factor = filter_reach(sampling_rate_hz, band_high_hz)
    lead = int(LEAD_SECONDS * sampling_rate_hz) + reach
    begin = hit.pulse.start - lead - reach
    free = hit.pulse.end + min(RINGING_SAMPLES, int(0.002 * sampling_rate_hz) + 1)
    signals = _centred(hit, begin, free)
    driven, rate = band_limited(signals, sampling_rate_hz, band_high_hz)
    first_free = -((begin - free) // factor)
    return Cut(driven, first_free, rate)


def _centred(hit: HitRecord, begin: int, free: int) -> FloatArray:
    """Force and accelerations from `begin` to the end of the ring-down, free of their offset."""
    first = max(0, begin)
    stop = hit.pulse.stop
    signals = np.zeros((1 + len(hit.accelerations), stop - begin))
    known = signals[:, first - begin :]
    np.subtract(hit.force[first:stop], np.median(hit.force[free:stop]), out=known[0])
    offset = hit.accelerations[:, free:stop].mean(axis=1, keepdims=True)
    np.subtract(hit.accelerations[:, first:stop], offset, out=known[1:])
    before = known[:, : hit.pulse.start - first]
    before[:] = np.nan_to_num(before)
    return signals
