"""The default identifier: subspace identification of free decays, Hankel matrices summed over hits.

Each hit's ring-down gives one Hankel matrix of future responses times past references. Poles that
stay from order to order, and stay when any one hit is left out, are modes. Frequency and damping
are medians over a few high orders; standard deviations are the jackknife's. Ambient motion goes
the same way: the covariances of white-noise-driven modes are sums of free decays.
"""

from __future__ import annotations

from dataclasses import replace

from shm.identify.contract import Finding, Measurement
from shm.identify.finding.state_space import block_rows, modes_of_hankel, references
from shm.identify.finding.subspace import hankel
from shm.identify.options import IdentifyOptions

_NOBODY_HIT = 2.0
"""The chance in ambient motion moves a frequency more than noise does a ring-down's: so many times
the largest standard deviation of a hammer test are taken."""


def summed_hankel_ssi(measurement: Measurement, options: IdentifyOptions) -> Finding:
    """Modes of a measurement by multi-hit SSI (see the module's text)."""
    mixed = references(measurement.decays)
    rows = block_rows(measurement, options)
    matrices = [hankel(decay, mixed @ decay, rows) for decay in measurement.decays]
    if measurement.frequency_response is None:
        options = replace(options, max_frequency_sd=_NOBODY_HIT * options.max_frequency_sd)
    return modes_of_hankel(matrices, rows, measurement, options)
