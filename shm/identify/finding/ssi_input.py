"""Subspace identification with the hammer's force as input, Hankel matrices summed over hits.

Where the free decay is what follows the pulse, this one looks at each hit from before the hammer
strikes. What the measured force explains is projected out of the future responses, so a second
blow, or a force that does not end, does no harm; the pulse needs no end.
"""

from __future__ import annotations

from shm.errors import NotIdentifiable
from shm.identify.contract import Finding, Measurement
from shm.identify.finding.state_space import block_rows, modes_of_hankel, references
from shm.identify.finding.subspace import hankel_with_input
from shm.identify.options import IdentifyOptions


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
