"""Options for records that were made for their whole band."""

from __future__ import annotations

from collections.abc import Sequence

from shm.identify.options import IdentifyOptions
from shm.values import Recording

_PASSED = 0.4
"""Of the sampling rate: what anti-aliasing filters pass."""


def campaign_options(
    records: Sequence[Recording],
    *,
    reference_force_n: float = 1000.0,
    frequency_allowance: float = 1e-4,
    shape_allowance: float = 0.005,
) -> IdentifyOptions:
    """The defaults of the settings, and as the band all that the loggers of `records` pass.

    What hits repeat to 1e-4 of a shape, sensors clamped on again do not: half a percent is allowed.
    """
    return IdentifyOptions(
        band_high_hz=_PASSED * min(record.sampling_rate_hz for record in records),
        reference_force_n=reference_force_n,
        frequency_allowance=frequency_allowance,
        shape_allowance=shape_allowance,
    )
