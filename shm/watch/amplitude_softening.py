"""What the swing does to a hanger's frequencies where its joints slip or it stretches.

Identification gives the frequency of small amplitude where the slope is sure, and so tests at any
amplitude compare. Where it is not sure in a test but was in the baseline, so much of the baseline's
slope is taken off, at the test's own amplitude, as such a frequency holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.values import FloatArray, IntArray, ModalTest, Mode
from shm.watch.quantities import MeasuredMode

# Of the slope, in a frequency that is not of small amplitude. The mean weighted with the energy of
# a ring-down, while the amplitude falls as exp(-t), has 2/3 of it: the integral of exp(-3t) over
# that of exp(-2t). Measured of softening and hardening hangers: median 0.5, quartiles 0.2 and 1.1
# (tests/benchmarks/identify_ablation.py); the sd is half of their distance over 0.674.
SHARE, SHARE_SD = 0.5, 0.65


@dataclass(frozen=True, eq=False)
class AmplitudeSlopes:
    """Of the baseline, by mode (modes,): change of the log frequency by unit amplitude, its sd, and
    the usual amplitude; 0 of a mode of which no test is sure."""

    slope: FloatArray
    sd: FloatArray
    usual: FloatArray

    @classmethod
    def of(cls, tests: Sequence[ModalTest], modes: Sequence[MeasuredMode]) -> AmplitudeSlopes:
        """From those tests that are sure, weighted by their errors."""
        found = np.zeros((3, len(modes)))
        for column, key in enumerate(modes):
            seen = [
                (mode.amplitude_slope, mode.amplitude_slope_sd, test.amplitude)
                for test in tests
                for mode in test.regular_modes
                if (mode.plane, mode.order) == key and mode.depends_on_amplitude
            ]
            if seen:
                slope, sd, level = np.array(seen).T
                level = np.where(level > 0, level, 1.0)
                # A slope that is known to 1 % is known well enough; none is known exactly.
                weight = (level / np.maximum(sd, 0.01 * np.abs(slope))) ** 2
                mean = weight @ (slope / level) / weight.sum()
                found[:, column] = mean, weight.sum() ** -0.5, level.mean()
        return cls(*found)

    def at(
        self, test: ModalTest, modes: Sequence[Mode], own: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """How far the log frequencies (n,) of a test's `modes` are off those of small amplitude,
        and the sds; `own` (n,) are their columns. An amplitude not known is the baseline's."""
        level = test.amplitude if test.amplitude > 0 else self.usual[own]
        level = np.where([mode.depends_on_amplitude for mode in modes], 0.0, level)
        slope, sd = level * self.slope[own], level * self.sd[own]
        return SHARE * slope, np.hypot(SHARE * sd, SHARE_SD * np.hypot(slope, sd))
