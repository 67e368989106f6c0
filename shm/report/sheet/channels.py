"""Which accelerations of a record are drawn, where there are many."""

from __future__ import annotations

import numpy as np

from shm.report.contents import TestSheet
from shm.values import Channel

_MOST_FAULTY = 2


def shown_rows(sheet: TestSheet, most: int) -> list[int]:
    """Rows of the accelerations to draw: a few that were left out, then of each plane in turn
    the first, the last, those between."""
    channels = sheet.recordings[0].accelerations
    faults = sheet.channel_faults
    faulty = [row for row, channel in enumerate(channels) if channel.name in faults]
    sound = [row for row in range(len(channels)) if row not in faulty]
    chosen = faulty[:_MOST_FAULTY]
    chosen += _in_turn(channels, sound)[: max(1, most - len(chosen))]
    return sorted(chosen)


def _in_turn(channels: tuple[Channel, ...], rows: list[int]) -> list[int]:
    planes = list(dict.fromkeys(channels[row].plane for row in rows))
    queues = [_ends_first([r for r in rows if channels[r].plane == plane]) for plane in planes]
    longest = max((len(queue) for queue in queues), default=0)
    return [queue[turn] for turn in range(longest) for queue in queues if turn < len(queue)]


def _ends_first(rows: list[int]) -> list[int]:
    return [rows[0], *rows[:0:-1]] if rows else []


def strongest_row(sheet: TestSheet) -> int:
    """Row of the acceleration that moves most in the first record, faulty ones aside."""
    faults = sheet.channel_faults
    peaks = [
        -1.0 if channel.name in faults else float(np.nanmax(np.abs(channel.values), initial=0.0))
        for channel in sheet.recordings[0].accelerations
    ]
    return int(np.argmax(peaks))
