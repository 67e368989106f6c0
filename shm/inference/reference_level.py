"""Move the frequencies of a test to a stated level of motion, by the slopes of its ring-downs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shm.errors import BadInput
from shm.identify.estimation.amplitude_dependence import LAWS
from shm.values import NAN, ModalTest, Mode


def at_level(test: ModalTest, level: float) -> ModalTest:
    """Return a test with the frequencies that it has at a level, in the unit of its amplitude.

    A frequency is that of small amplitude times 1 + slope g, g of 0 at rest and 1 at the test's
    own hits. Between them g is the mean of the laws by which identification finds the slope, and
    their standard deviation is part of the frequency's. Where no slope of the test is significant,
    frequencies stay, less sure by as much as the slopes may hide. Raises BadInput where the test
    has no slopes, and above the level of its hits, which no law is known to reach.
    """
    slopes = [mode.amplitude_slope for mode in test.modes]
    if not (test.amplitude > 0 and np.isfinite(slopes).any()):
        raise BadInput(
            f"test {test.id} does not say how its frequencies depend on amplitude.",
            remedy="Identify it from a recording of hammer hits (`shm identify`).",
        )
    ratio = level / test.amplitude
    if not 0 <= ratio <= 1:
        raise BadInput(
            f"level {level:g} is above {test.amplitude:.3g}, that of the hits of test {test.id}.",
            remedy="Ask for a level up to that, or hit harder.",
        )
    courses = np.array([float(law(np.array([ratio]))[0]) for law in LAWS])
    course, course_sd = float(courses.mean()), float(courses.std())
    depends = any(mode.depends_on_amplitude for mode in test.modes)
    moved = (_moved(mode, course, course_sd, depends=depends) for mode in test.modes)
    return replace(test, modes=tuple(moved), amplitude=level)


def _moved(mode: Mode, course: float, course_sd: float, *, depends: bool) -> Mode:
    slope, sd = mode.amplitude_slope, mode.amplitude_slope_sd
    if not math.isfinite(slope):
        return mode
    sd = sd if math.isfinite(sd) else abs(slope)
    shift = slope * course if depends else 0.0
    shift_sd = (
        math.hypot(sd * course, slope * course_sd) if depends else sd * max(course, 1 - course)
    )
    known_sd_hz = mode.frequency_sd_hz if math.isfinite(mode.frequency_sd_hz) else 0.0
    return replace(
        mode,
        frequency_hz=mode.frequency_hz * (1 + shift),
        frequency_sd_hz=math.hypot(known_sd_hz, shift_sd * mode.frequency_hz),
        amplitude_slope=NAN,
        amplitude_slope_sd=NAN,
    )
