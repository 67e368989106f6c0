"""Check a finding after identification: windows, incoherence and sidebands.

An exponential window's damping is removed; incoherent modes and lines that modulation of a mode's
ringing makes are no modes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from shm.identify.contract import Dropped, Finding, FoundMode, Measurement
from shm.identify.estimation.amplitude_dependence import with_amplitude_dependence
from shm.identify.estimation.shapes import modal_assurance
from shm.identify.options import IdentifyOptions
from shm.values import FloatArray

_LINES_AROUND = 4  # judgement: nine lines have a median that one bad line does not move


def postprocess(found: Finding, measurement: Measurement, options: IdentifyOptions) -> Finding:
    """Return the finding without window damping, incoherent modes and sidebands.

    Frequencies have their dependence on amplitude.
    """
    found = coherent_only(without_window(found, measurement), measurement, options)
    return with_amplitude_dependence(found, measurement)


def without_window(found: Finding, measurement: Measurement) -> Finding:
    """Return the finding with the damping of an exponential window taken off its damping ratios."""
    rate = 1 / measurement.decay_time_constant_s
    modes, doubtful = (
        tuple(
            replace(m, damping_ratio=m.damping_ratio - rate / (2 * math.pi * m.frequency_hz))
            for m in each
        )
        for each in (found.modes, found.doubtful)
    )
    return replace(found, modes=modes, doubtful=doubtful)


def coherent_only(found: Finding, measurement: Measurement, options: IdentifyOptions) -> Finding:
    """Return the finding without modes at which the measured coherence is low.

    Only for decays made from frequency responses: after hits, coherence also falls where a hit
    came before the last had rung down, which free decays do not mind.
    """
    response = measurement.frequency_response
    if measurement.hits or response is None or response.coherence is None:
        return found
    frequency_hz, coherence = response.frequency_hz, response.coherence
    reason = f"coherence below {options.min_coherence:g}"
    modes, dropped = [], list(found.dropped)
    for mode in found.modes:
        if _coherence(mode, frequency_hz, coherence) >= options.min_coherence:
            modes.append(mode)
        else:
            dropped.append(Dropped(f"mode at {mode.frequency_hz:.4g} Hz", 1, reason))
    return replace(found, modes=tuple(modes), dropped=tuple(dropped))


def _coherence(mode: FoundMode, frequency_hz: FloatArray, coherence: FloatArray) -> float:
    """Return the median coherence over the points and the lines around a mode."""
    line = int(np.argmin(np.abs(frequency_hz - mode.frequency_hz)))
    near = coherence[:, max(0, line - _LINES_AROUND) : line + _LINES_AROUND + 1]
    return float(np.median(near))


_SIDEBANDS_WITHIN_HZ = 5.0  # judgement: what machines and traffic do to a hanger's motion is slower
_SIDEBAND_SHAPE = 0.98
_SIDEBAND_RATE = 0.3
"""Of the mode's own rate of decay: a line of a tenth of its amplitude is known to about that."""
_SIDEBAND_SHARE = 0.4  # of the mode's amplitude: half of what makes it fall to a fifth and rise
_MAX_SIDEBAND_RATIO = 1.6  # judgement: of the amplitudes of two lines that modulation makes alike
_SIDEBAND_TOLERANCE = 0.1
"""Of the rate of decay, in rad/s: by so much of a line's width its middle may be off."""


def without_sidebands(found: Finding) -> Finding:
    """Return the finding without pairs of lines that are sidebands of a mode between them.

    A slow machine makes them by modulating the mode's ringing: exp(-s t) cos(w t) (1 + m cos(v
    t)) is the mode and two lines at w - v and w + v with its shape and its rate of decay s, and
    m/2 of its amplitude each. Two modes of a hanger at such frequencies do not also decay at
    its rate with equal strength.
    """
    lines: dict[int, FoundMode] = {}
    for carrier in found.modes:
        for one, other in combinations(_weaker_neighbours(carrier, found.modes), 2):
            if _are_sidebands(carrier, one, other):
                lines[id(one)] = lines[id(other)] = carrier
    dropped = tuple(
        Dropped(
            f"mode at {mode.frequency_hz:.4g} Hz",
            1,
            f"sideband of the mode at {lines[id(mode)].frequency_hz:.4g} Hz, whose ringing "
            "something makes larger and smaller",
        )
        for mode in found.modes
        if id(mode) in lines
    )
    modes = tuple(mode for mode in found.modes if id(mode) not in lines)
    return replace(found, modes=modes, dropped=found.dropped + dropped)


def _weaker_neighbours(carrier: FoundMode, modes: Sequence[FoundMode]) -> list[FoundMode]:
    """Return weaker modes close to the carrier that share its shape and rate of decay."""
    rate = _decay_rate(carrier)
    return [
        mode
        for mode in modes
        if mode is not carrier
        and abs(mode.frequency_hz - carrier.frequency_hz) < _SIDEBANDS_WITHIN_HZ
        and abs(_decay_rate(mode) - rate) < _SIDEBAND_RATE * rate
        and mode.acceleration_m_s2 < _SIDEBAND_SHARE * carrier.acceleration_m_s2
        and modal_assurance(mode.shape, carrier.shape) > _SIDEBAND_SHAPE
    ]


def _are_sidebands(carrier: FoundMode, one: FoundMode, other: FoundMode) -> bool:
    """Return whether the two are symmetric about the mode and about equally strong."""
    off_hz = abs(one.frequency_hz + other.frequency_hz - 2 * carrier.frequency_hz)
    sds = [mode.frequency_sd_hz for mode in (one, other, carrier, carrier)]
    hits_known = not any(math.isnan(mode.damping_sd) for mode in (one, other, carrier))
    scatter_hz = 3 * float(np.linalg.norm(sds)) if hits_known else 0.0
    tolerance_hz = max(scatter_hz, _SIDEBAND_TOLERANCE * _decay_rate(carrier) / (2 * math.pi))
    strong = sorted(mode.acceleration_m_s2 for mode in (one, other))
    return off_hz < tolerance_hz and strong[1] < _MAX_SIDEBAND_RATIO * strong[0]


def _decay_rate(mode: FoundMode) -> float:
    """Return the rate of the mode's decay in rad/s."""
    return 2 * math.pi * mode.frequency_hz * mode.damping_ratio
