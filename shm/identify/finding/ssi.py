"""The default identifier: subspace identification of free decays, Hankel matrices summed over hits.

Each hit's ring-down gives one Hankel matrix of future responses times past references. Poles that
stay from order to order, and stay when any one hit is left out, are modes. Frequency and damping
are medians over a few high orders; standard deviations are the jackknife's. Ambient motion goes
the same way: the covariances of white-noise-driven modes are sums of free decays.

Subspace identification with the hammer's force as input, Hankel matrices summed over hits.

Where the free decay is what follows the pulse, this one looks at each hit from before the hammer
strikes. What the measured force explains is projected out of the future responses, so a second
blow, or a force that does not end, does no harm; the pulse needs no end.
"""

from __future__ import annotations

from dataclasses import replace

from shm.errors import NotIdentifiable
from shm.identify.contract import Finding, Measurement
from shm.identify.finding.state_space import block_rows, modes_of_hankel, references
from shm.identify.finding.subspace import hankel, hankel_with_input
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


def summed_hankel_ssi_with_input(measurement: Measurement, options: IdentifyOptions) -> Finding:
    """Modes of a measurement by multi-hit SSI with the force as input.

    Raises NotIdentifiable where the measurement holds no force over time.
    """
    if not measurement.driven:
        raise NotIdentifiable(
            "identifier 'ssi-input' needs the hammer's force over time.",
            file=measurement.source,
            remedy="Give time records with a force channel, or use the identifier 'ssi'.",
        )
    mixed = references(measurement.decays)
    rows = block_rows(measurement, options)
    matrices = [
        hankel_with_input(driven[1:], mixed @ driven[1:], driven[:1], rows)
        for driven in measurement.driven
    ]
    return modes_of_hankel(matrices, rows, measurement, options)
