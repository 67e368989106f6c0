"""The guided hammer test: levels, hits checked while they are made, and when they are enough."""

from __future__ import annotations

from shm.acquire.devices import Device, DeviceLost, SimulatedDevice, SoundCard
from shm.acquire.guide import Acquired, AcquireOptions, acquire

__all__ = [
    "AcquireOptions", "Acquired", "Device", "DeviceLost", "SimulatedDevice", "SoundCard", "acquire",
]  # fmt: skip
