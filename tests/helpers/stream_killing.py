"""A process that appends chunks and seals, to be killed: what it acknowledged must be there once.

Run as a module: `python -m tests.helpers.stream_killing RING FIRST`. It prints the number of each
chunk once it is acknowledged.
"""

from __future__ import annotations

import random
import subprocess
import sys
import time
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from shm.read.chunk_document import chunk_document
from shm.store.ring import Ring
from tests.helpers.nouns import NOW
from tests.helpers.streams import STREAM, a_chunk, list_excluded

SAMPLES = 6000
"""A minute a chunk, so that ten minutes are sealed at every tenth."""


def append_and_seal(folder: Path, first: int) -> None:
    """Goes on for ever; the clock is that of the chunks."""
    now = [NOW]
    ring = Ring(folder, clock=lambda: now[0])
    for number in range(first, sys.maxsize):
        chunk = a_chunk(number, samples=SAMPLES)
        now[0] = chunk.end
        ring.append(chunk_document(chunk))
        print(number, flush=True)
        ring.seal(now[0] + timedelta(seconds=20))


def killed_again_and_again(folder: Path, kills: int, rng: random.Random) -> int:
    """Kills the process at random moments; how many chunks it acknowledged in all."""
    acknowledged = 0
    for _ in range(kills):
        # It sends again what was not acknowledged, and the last that was: the answer may be lost.
        first = max(acknowledged - 1, 0)
        command = [sys.executable, "-m", "tests.helpers.stream_killing", str(folder), str(first)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
            assert child.stdout is not None
            told = child.stdout.readline()
            time.sleep(rng.uniform(0.0, 0.6))
            child.kill()
            numbers = [int(each) for each in (told + child.stdout.read()).split()]
        acknowledged = max([acknowledged, *(number + 1 for number in numbers)])
    return acknowledged


def assert_none_lost_none_doubled(folder: Path, acknowledged: int) -> None:
    """As it lies there, and once all is sealed."""
    rate = STREAM.sampling_rate_hz
    ring = Ring(folder)
    end = NOW + timedelta(seconds=(acknowledged + 20) * SAMPLES / rate)
    for _ in range(2):
        samples = 0
        for number in range(acknowledged):
            expected = a_chunk(number, samples=SAMPLES)
            (piece,) = ring.read("h3", expected.start, expected.end)
            assert np.array_equal(piece.values, expected.values), number
        for piece in ring.read("h3", NOW, end):
            samples += piece.values.shape[1]
        # The chunk that was under way may be there too, unacknowledged.
        assert samples in (acknowledged * SAMPLES, (acknowledged + 1) * SAMPLES)
        ring.seal(datetime.now(end.tzinfo) + timedelta(days=3650))
    assert not ring.unsealed_periods("h3")
    assert list_excluded(ring) == []
    assert not (folder / "h3" / "aside").exists()


if __name__ == "__main__":
    append_and_seal(Path(sys.argv[1]), int(sys.argv[2]))
