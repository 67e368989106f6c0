"""Track the modes of permanent sensors: windows, pooling by hour and day, health of sensors.

Pure functions of values; what runs them, and where their answers are kept, is above.
"""

from __future__ import annotations

from shm.monitor.pooling import as_modal_test, pooled
from shm.monitor.sensor_health import find_lost_planes, sees_nothing, sensor_faults
from shm.monitor.tracking import read_window
from shm.monitor.windows import cut

__all__ = [
    "as_modal_test", "cut", "find_lost_planes", "pooled", "read_window", "sees_nothing",
    "sensor_faults",
]  # fmt: skip
