"""Recordings in files of single precision: half the size, and far below any sensor's noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from shm.read.registry import write
from shm.values import Channel, FloatArray, Recording


def write_single(recording: Recording, path: Path) -> None:
    """Writes an .npz file, not compressed: its size tells the numbers of samples and channels."""
    write(replace(recording, channels=tuple(map(_single, recording.channels))), path)


def _single(channel: Channel) -> Channel:
    values = channel.values.astype(np.float32)
    return replace(channel, values=cast(FloatArray, values))
