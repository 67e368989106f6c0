"""Make a measurement of measured frequency responses, by way of their impulse responses.

Points hit one after the other (roving hammer) are, by reciprocity, channels of one response.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress, pairwise

import numpy as np

from shm.errors import BadInput, NotIdentifiable
from shm.identify.contract import Dropped, Measurement
from shm.identify.measuring.band import LEAST_SAMPLES, band_limited
from shm.identify.measuring.hits import RINGING_SAMPLES
from shm.identify.options import IdentifyOptions
from shm.values import FloatArray, FrequencyResponse

_MOST_SAMPLES = 16_000  # judgement: a minute at 256 Hz, in which all modes have rung down
_MOST_SAMPLES_ROVING = 1_000
"""Points measured one after the other differ by some 1e-4 in frequency. This many samples, some 500
periods of the highest mode, are too few to tell that apart, and enough for damping."""
_USED_SHARE = 0.8
"""The end of an inverse transform holds what leaked ahead of the hit."""


def measurement_of_responses(
    responses: Sequence[FrequencyResponse], options: IdentifyOptions
) -> Measurement:
    """Return the measurement in the frequency responses of one test.

    Raises BadInput where their lines differ, NotIdentifiable where no point is left to use.
    """
    for first, second in pairwise(responses):
        _refuse_different(first, second)
    merged, dropped = _merged(responses, options)
    most_samples = _MOST_SAMPLES if len(responses) == 1 else _MOST_SAMPLES_ROVING
    decay, rate = _impulse_responses(merged, options, most_samples)
    if not merged.points or decay.shape[1] < LEAST_SAMPLES:
        raise NotIdentifiable(
            "no frequency response with enough finite lines in the band.",
            file=responses[0].source,
            remedy="Check the export, or widen the band.",
        )
    return Measurement(
        source=merged.source,
        points=merged.points,
        decays=(decay,),
        sampling_rate_hz=rate,
        frequency_response=merged,
        window_time_constant_s=options.window_time_constant_s,
        decay_time_constant_s=options.window_time_constant_s,
        dropped=dropped,
    )


def _refuse_different(first: FrequencyResponse, second: FrequencyResponse) -> None:
    same_length = len(first.frequency_hz) == len(second.frequency_hz)
    if not (same_length and np.allclose(first.frequency_hz, second.frequency_hz)):
        raise BadInput(
            f"its frequency lines differ from those of {first.source}.",
            file=second.source,
            remedy="Export all responses of a test with the same lines.",
        )


def _merged(
    responses: Sequence[FrequencyResponse], options: IdentifyOptions
) -> tuple[FrequencyResponse, tuple[Dropped, ...]]:
    """Merge all points with finite lines in the band into one response; also return the others."""
    first = responses[0]
    lines = (first.frequency_hz >= options.band_low_hz) & (
        first.frequency_hz <= options.band_high_hz
    )
    points = [point for response in responses for point in response.points]
    accelerance = np.vstack([response.accelerance for response in responses])
    good = np.all(np.isfinite(accelerance[:, lines]), axis=1)
    coherences = [r.coherence for r in responses if r.coherence is not None]
    known = len(coherences) == len(responses)
    merged = replace(
        first,
        points=tuple(compress(points, good)),
        accelerance=accelerance[good],
        coherence=np.vstack(coherences)[good] if known else None,
    )
    reason = "not-a-number lines in the band"
    return merged, tuple(Dropped(f"point {p.name}", 1, reason) for p in compress(points, ~good))


def _impulse_responses(
    response: FrequencyResponse, options: IdentifyOptions, most_samples: int
) -> tuple[FloatArray, float]:
    """Return impulse responses (points, samples) without first and last part, and their rate."""
    rate = 2 * float(response.frequency_hz[-1])
    # Lines outside of the band, such as H1's 0/0 at zero frequency, may be unknown: they count 0.
    known = np.where(np.isfinite(response.accelerance), response.accelerance, 0)
    impulse = np.fft.irfft(known, n=2 * (known.shape[1] - 1), axis=1)
    used = impulse[:, RINGING_SAMPLES : int(_USED_SHARE * impulse.shape[1])]
    if used.shape[1] < LEAST_SAMPLES:
        return used, rate
    decay, rate = band_limited(used, rate, options.band_high_hz)
    return decay[:, :most_samples], rate
