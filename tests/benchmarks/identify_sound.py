"""Which checks warn of sound recordings, and by how much that widens standard deviations.

    python tests/benchmarks/identify_sound.py --seeds 0:20

Hammer tests of linear bars in wind, by `tests/worlds/recordings.py`: its sensors, cables and
loggers, but no mains, no machine and no second blow. A warning of such a record is wrong, unless it
is of the crew's work (`OF_THE_CREW`).
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np

from shm.errors import ShmError
from shm.identify import Identification, IdentifyOptions, identify
from shm.identify.estimation import postprocess
from tests.benchmarks.recordings_trial import as_record, described
from tests.worlds import recordings as world
from tests.worlds.recorded_kinds import KINDS

OF_THE_CREW = {"coherence", "first orders", "force spectrum", "hits", "noise", "numbering",
               "pre-trigger", "repeatability", "ring-down"}  # fmt: skip
"""Checks that say what a test lacks: too few hits, hits of several directions (up to 20 degrees off
here), a soft tip, no time to ring down."""
PLAN = replace(KINDS["plain"].plan, hits=(4, 8), rebounds=0.0)


def sound(seed: int) -> world.Recording:
    """Draw a recording without mains."""
    wires = world._wires

    def still(*given: Any) -> list[Any]:
        return [replace(wire, hum=0.0) for wire in wires(*given)]

    with patch.object(world, "_wires", still):
        return world.recorded(np.random.default_rng([77, seed]), PLAN, "sound", seed)


def made(case: world.Recording) -> Identification | None:
    try:
        return identify([as_record(case)], IdentifyOptions(), test_id="s", hanger=described(case))
    except ShmError:
        return None


def widening(found: Identification, plain: Identification | None) -> list[float]:
    """Return each standard deviation of a frequency over that without any look at amplitudes."""
    other = {(m.plane, m.order): m for m in plain.test.modes} if plain else {}
    return [
        mode.frequency_sd_hz / other[mode.plane, mode.order].frequency_sd_hz
        for mode in found.test.modes
        if (mode.plane, mode.order) in other
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="0:20", help="first:end")
    seeds = range(*map(int, parser.parse_args(arguments).seeds.split(":")))
    counts: Counter[str] = Counter()
    wrongly, wide, total = 0, [], 0
    for seed in seeds:
        case = sound(seed)
        found = made(case)
        if found is None:
            counts["refused"] += 1
            continue
        total += 1
        warned = [each.name for each in found.quality if each.verdict == "warning"]
        counts.update(warned)
        wrongly += bool(set(warned) - OF_THE_CREW)
        with patch.object(postprocess, "with_amplitude_dependence", lambda found, _: found):
            ratios = widening(found, made(case))
        if {"amplitude", "tones"} & set(warned):
            wide += ratios
        print(seed, warned, f"widest {max(ratios, default=1.0):.1f}", flush=True)
    print(dict(counts))
    print(f"{wrongly} of {total} carry a wrong warning; widest by {max(wide, default=1.0):.1f}")


if __name__ == "__main__":
    main()
