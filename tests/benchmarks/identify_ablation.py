"""What `identify` loses without one of its steps or constants.

    python tests/benchmarks/identify_ablation.py --kinds softening,hardening --seeds 3:11
    python tests/benchmarks/identify_ablation.py --steps --kinds plain,close_planes,low_signal

Recordings of `tests/worlds/recordings.py`. Without `--steps` each is identified once, and its
frequencies are taken to small amplitude with each constant of `amplitude_dependence` in turn
left out: median error, coverage of the 90 % intervals, and how much of its slope a frequency holds
that is not of small amplitude. With `--steps` it is identified anew without each step.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest.mock import patch

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE)]

from recordings_trial import (  # noqa: E402
    LEAST_SNR_DB,
    NINETY,
    SAME_MODE,
    as_record,
    described,
)

from shm.errors import ShmError  # noqa: E402
from shm.identify import IdentifyOptions, identify  # noqa: E402
from shm.identify.contract import Finding  # noqa: E402
from shm.identify.estimation import (  # noqa: E402
    amplitude_dependence,
    courses,
    finished,
    stabilise,
)
from tests.worlds import recordings as world  # noqa: E402

CONSTANTS: Mapping[str, tuple[Any, str, float] | None] = {
    "all as they are": None,
    "the error of the law": (amplitude_dependence, "_LAW_ERROR", 0.0),
    "others' shifts when unsure": (amplitude_dependence, "_BY_CHANCE", -1.0),
    "the overlap of stretches": (amplitude_dependence, "OVERLAP", 1.0),
    "half as sure a phase": (courses, "_LEAST_RATIO", 4.0),
    "stretches twice as long": (courses, "_STRETCH_SECONDS", 1.0),
}
AS_FOUND = "any correction"
STEPS: Mapping[str, Mapping[str, Any]] = {
    "all as it is": {},
    "without close pairs": {},
    "identifier frf": {"identifier": "frf"},
}
Errors = dict[str, list[tuple[float, float]]]
"""By variant the relative error of each mode, and the same over its standard deviation."""


def heard_hz(case: world.Recording) -> list[float]:
    """The frequencies to be found, as the file's own clock shows them."""
    planes = {channel.plane for channel in case.channels if channel.quantity == "acceleration"}
    clock, options = 1 + case.truth.time_base_error, IdentifyOptions()
    shown = [
        mode.frequency_hz / clock
        for mode in case.truth.modes
        if mode.snr_db >= LEAST_SNR_DB and mode.plane in planes
    ]
    return [hz for hz in shown if options.band_low_hz <= hz <= options.band_high_hz]


def nearest(hz: float, modes: Sequence[Any]) -> Any:
    """The mode of that frequency; None where none is near."""
    near = [mode for mode in modes if abs(mode.frequency_hz / hz - 1) < SAME_MODE]
    return min(near, key=lambda mode: abs(mode.frequency_hz - hz), default=None)


def put(errors: Errors, variant: str, truths_hz: Sequence[float], modes: Sequence[Any]) -> None:
    for hz in truths_hz:
        mode = nearest(hz, modes)
        own = mode and min(truths_hz, key=lambda true, at=mode: abs(at.frequency_hz - true))
        if own == hz:  # else it is a neighbour's, and this one was missed
            off_hz = abs(mode.frequency_hz - hz)
            errors[variant].append((off_hz / hz, off_hz / mode.frequency_sd_hz))


def without_constants(cases: Iterator[world.Recording]) -> None:
    """Prints what each constant is worth, and the share of a slope in frequencies as found."""
    own = amplitude_dependence.with_amplitude_dependence
    errors: Errors = defaultdict(list)
    shares: list[float] = []
    for case in cases:
        truths_hz = heard_hz(case)

        def all_ways(found: Finding, measurement: Any, hz: list[float] = truths_hz) -> Finding:
            for name, changed in CONSTANTS.items():
                with patch.object(*changed) if changed else ExitStack():
                    put(errors, name, hz, own(found, measurement).modes)
            put(errors, AS_FOUND, hz, found.modes)
            corrected = own(found, measurement)
            for before, after in zip(found.modes, corrected.modes, strict=True):
                true = [f for f in hz if abs(f / after.frequency_hz - 1) < SAME_MODE]
                slope, sd = after.amplitude_slope, after.amplitude_slope_sd
                if true and max(2.5 * sd, 1e-4) < abs(slope) < 0.01:
                    at_rest = min(true, key=lambda f: abs(f - after.frequency_hz))
                    shares.append((before.frequency_hz / at_rest - 1) / slope)
            return corrected

        with patch.object(finished, "with_amplitude_dependence", all_ways):
            _identified(case, {})
    for name, rows in errors.items():
        error, z = np.array(rows).T
        print(
            f"without {name:28s} {len(rows):4d} modes, median error {np.median(error):.1e}, "
            f"90 % intervals cover {np.mean(z < NINETY):.3f}"
        )
    print("share of the slope, quartiles:", np.quantile(shares, [0.25, 0.5, 0.75]).round(2))


def without_steps(cases: Iterator[world.Recording]) -> None:
    """Prints what is found without each step."""
    found, expected, reported = (dict.fromkeys(STEPS, 0) for _ in range(3))
    for case in cases:
        truths_hz = heard_hz(case)
        for name, options in STEPS.items():
            is_off = name == "without close pairs"
            with patch.object(stabilise, "told_apart", _left) if is_off else ExitStack():
                modes = list(_identified(case, options))
            reported[name] += len(modes)
            expected[name] += len(truths_hz)
            for hz in truths_hz:
                mode = nearest(hz, modes)
                if mode is not None:
                    modes.remove(mode)
                    found[name] += 1
    for name in STEPS:
        print(f"{name:24s} {found[name]} of {expected[name]} found, {reported[name]} reported")


def _left(single: Sequence[Any], again: Sequence[Any], *_: Any) -> tuple[list[Any], list[Any]]:
    """In place of `told_apart`: pairs stay as they were."""
    return list(single), list(again)


def _identified(case: world.Recording, options: Mapping[str, Any]) -> Sequence[Any]:
    try:
        made = identify(
            [as_record(case)], IdentifyOptions(**options), test_id="t", hanger=described(case)
        )
    except ShmError:
        return ()
    return made.test.modes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kinds", default="softening,hardening", help="parted by commas")
    parser.add_argument("--seeds", default="3:11", help="first:end")
    parser.add_argument("--steps", action="store_true", help="leave steps out, not constants")
    arguments = parser.parse_args()
    first, end = map(int, arguments.seeds.split(":"))
    cases = (world.case(k, n) for k in arguments.kinds.split(",") for n in range(first, end))
    (without_steps if arguments.steps else without_constants)(cases)


if __name__ == "__main__":
    main()
