"""Check `ring-down`: how far the vibration has fallen when its record ends."""

from __future__ import annotations

import numpy as np

from shm.identify.measuring.signal_faults import CUT_OFF
from shm.identify.quality.inspection import Inspection
from shm.identify.quality.wording import hits_for, hits_of, places
from shm.values import FloatArray, QualityCheck

_LIMIT_DB = -3.0
"""Above it less than a third of a time constant is seen: damping rests on a small difference."""


def check(inspection: Inspection) -> QualityCheck | None:
    """Level of a ring-down's last tenth over its first, in dB, median over the used hits."""
    if not hits_of(inspection):
        return None
    levels = [_level_db(d) for measurement in inspection.measurements for d in measurement.decays]
    level = float(np.median(levels))
    short = hits_for(inspection, (CUT_OFF,))
    found = f"it ends {-level:.0f} dB below its beginning"
    if not short and level <= _LIMIT_DB:
        return QualityCheck("ring-down", "good", level, _LIMIT_DB, "dB", found)
    found = f"{places(inspection, short)} is cut off and left out; {found}" if short else found
    return QualityCheck(
        "ring-down", "warning", level, _LIMIT_DB, "dB", found,
        "Wait longer before the next hit and before stopping the logger: until nothing moves.",
    )  # fmt: skip


def _level_db(decay: FloatArray) -> float:
    tenth = max(1, decay.shape[1] // 10)
    first, last = np.std(decay[:, :tenth]), np.std(decay[:, -tenth:])
    tiny = np.finfo(float).tiny
    return float(20 * np.log10(max(float(last), tiny) / max(float(first), tiny)))
