"""What `identify` loses without one of its steps or constants.

    python tests/benchmarks/identify_ablation.py --kinds softening,hardening --seeds 3:11
    python tests/benchmarks/identify_ablation.py --steps all --seeds 0:20

Without `--steps` each of the recordings of `tests/worlds/recordings.py` is identified once, and its
frequencies are taken to small amplitude with each constant of `amplitude_dependence` in turn left
out: median error, coverage of the 90 % intervals, and how much of its slope a frequency holds that
is not of small amplitude. With `--steps` the records that each step was made for are identified
with it and without it.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

import begin
import numpy as np
from cases import random_case
from gap_dynamics import drawn
from recordings_trial import (
    LEAST_SNR_DB,
    NINETY,
    SAME_MODE,
    as_record,
    described,
)

from shm.errors import ShmError
from shm.identify import IdentifyOptions, identification, identify
from shm.identify.contract import Finding
from shm.identify.estimation import (
    amplitude_dependence,
    courses,
    postprocess,
    ssi,
)
from shm.identify.measuring import screening
from shm.identify.mode_ordering import placement
from shm.values import Hanger, Recording
from tests.benchmarks.left_out import Change, without
from tests.helpers.struck import STRUCK, recordings
from tests.worlds import recordings as world
from tests.worlds import struck_bar

CONSTANTS: Mapping[str, Sequence[Change]] = {
    "all as they are": (),
    "the error of the law": [(amplitude_dependence, "_LAW_ERROR", 0.0)],
    "the overlap of stretches": [(amplitude_dependence, "OVERLAP", 1.0)],
    "half as sure a phase": [(courses, "_LEAST_RATIO", 4.0)],
    "stretches twice as long": [(courses, "_STRETCH_SECONDS", 1.0)],
}
AS_FOUND = "any correction"
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
                with without(changed):
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

        with patch.object(postprocess, "with_amplitude_dependence", all_ways):
            _identified(case, {})
    for name, rows in errors.items():
        error, z = np.array(rows).T
        print(
            f"without {name:28s} {len(rows):4d} modes, median error {np.median(error):.1e}, "
            f"90 % intervals cover {np.mean(z < NINETY):.3f}"
        )
    print("share of the slope, quartiles:", np.quantile(shares, [0.25, 0.5, 0.75]).round(2))


@dataclass
class Test:
    """Records of one test and its modes to be found: plane, order and Hz as the file shows them."""

    records: list[Recording]
    hanger: Hanger | None
    truths: list[tuple[str, int, float]]


def of_world(*kinds: str) -> Callable[[int], Iterator[Test]]:
    """Return what draws recordings of `tests/worlds/recordings.py`."""

    def draw(seed: int) -> Iterator[Test]:
        for kind in kinds:
            case = world.case(kind, seed)
            planes = {each.plane for each in case.channels if each.quantity == "acceleration"}
            clock = 1 + case.truth.time_base_error
            truths = [
                (mode.plane, mode.order, mode.frequency_hz / clock)
                for mode in case.truth.modes
                if mode.snr_db >= LEAST_SNR_DB and mode.plane in planes
            ]
            yield Test([as_record(case)], described(case), truths)

    return draw


def simulated(*faults: str) -> Callable[[int], Iterator[Test]]:
    """Return what draws random hangers with each of the faults; of none, their planes coincide."""

    def draw(seed: int) -> Iterator[Test]:
        for fault in faults or (None,):
            number = seed
            case = random_case(33, number, fault)
            while not fault and not any(truth.merged for truth in case.truths):
                number += 1000
                case = random_case(33, number)
            truths = [
                (truth.plane, truth.order, truth.frequency_hz)
                for truth in case.truths
                if truth.snr_db >= LEAST_SNR_DB and not truth.under_tone
            ]
            yield Test([case.made.recording], case.hanger, truths)

    return draw


def guided(seed: int) -> Iterator[Test]:
    """Draw a bar that knocks in a guide with play, hit hard."""
    part = drawn("guide", np.random.default_rng(seed))
    crew = struck_bar.Crew(hits=4)
    records = struck_bar.tested(
        struck_bar.Hanger(part=part), crew, 1.0, np.random.default_rng([seed, 1])
    )
    exact_hz = struck_bar.modes_of(struck_bar.Bar()).omega / (2 * np.pi)
    truths = [
        (plane, order, float(hz))
        for plane in struck_bar.PLANES
        for order, hz in enumerate(exact_hz[:9], 1)
    ]
    yield Test(recordings(records, crew), STRUCK, truths)


Draw = Callable[[int], Iterator[Test]]
STEPS: Mapping[str, tuple[Sequence[Change], Draw]] = {
    "close pairs": (
        ((ssi, "split_close_pairs", lambda one, again, *_: (one, again)),), simulated(),
    ),
    "calm part": (((identification, "_once_calm", lambda *_: None),), guided),
    "closer look at gaps": (
        ((placement, "_in_gaps", lambda *_: []),), of_world("plain", "close_planes", "low_signal"),
    ),
    "tones as modes": (
        ((placement, "without_tones", lambda found, *_, **__: (list(found), [])),),
        of_world("hum_at_mode"),
    ),
    "tones as modes of machines": (
        ((placement, "without_tones", lambda found, *_, **__: (list(found), [])),),
        simulated("mains", "machine"),
    ),
    "sidebands": (
        ((identification, "without_sidebands", lambda found: found),), of_world("sidebands"),
    ),
    "hits unlike the others": (
        ((screening, "outliers", lambda apart: np.zeros(len(apart), dtype=bool)),),
        simulated("outlier_hit"),
    ),
    "disturbed ring-downs": (
        ((screening, "until_disturbed", lambda _, downs, faults, *__: (downs, faults)),),
        simulated("double_hit", "cable", "drop_out"),
    ),
    "delays of channels": (((ssi, "delays_s", lambda *_: None),), of_world("plain")),
}  # fmt: skip
"""What is put in place of each step, and the records that it was made for."""


def without_steps(names: Sequence[str], seeds: Sequence[int]) -> None:
    """Print what is found with each step and without it."""
    for name in names:
        patches, draw = STEPS[name]
        counts = {True: Counter[str](), False: Counter[str]()}
        for seed in seeds:
            for test in draw(seed):
                for is_kept, count in counts.items():
                    with without(() if is_kept else patches):
                        count.update(_scored(test))
            for is_kept, count in counts.items():
                side = "with" if is_kept else "without"
                print(f"to seed {seed} {side:8s}{name:32s} {dict(count)}", flush=True)


def _scored(test: Test) -> dict[str, Any]:
    """Return modes to be found and found, wrong names, false ones and refused tests."""
    began = time.process_time()
    try:
        made = identify(test.records, IdentifyOptions(), test_id="t", hanger=test.hanger)
    except ShmError:
        return {"expected": len(test.truths), "refused": 1}
    modes = list(made.test.modes)
    found = 0
    for plane, order, hz in test.truths:
        own = [m for m in modes if (m.plane, m.order) == (plane, order) and _near(m, hz)]
        found += bool(own)
        modes = [m for m in modes if m not in own]
    wrong = sum(any(_near(mode, hz) for *_, hz in test.truths) for mode in modes)
    spent = round(100 * (time.process_time() - began))
    return {"expected": len(test.truths), "found": found, "wrong": wrong,
            "false": len(modes) - wrong, "centiseconds": spent}  # fmt: skip


def _near(mode: Any, hz: float) -> bool:
    return abs(mode.frequency_hz / hz - 1) < SAME_MODE


def _identified(case: world.Recording, options: Mapping[str, Any]) -> Sequence[Any]:
    try:
        made = identify(
            [as_record(case)], IdentifyOptions(**options), test_id="t", hanger=described(case)
        )
    except ShmError:
        return ()
    return made.test.modes


def main() -> None:
    arguments = begin.options(
        __doc__,
        kinds=begin.Told("softening,hardening", "parted by commas"),
        seeds=begin.Told("3:11", "first:end"),
        steps=begin.Told(str, "names of steps, parted by commas, or all"),
    )
    seeds = range(*map(int, arguments.seeds.split(":")))
    if arguments.steps:
        names = list(STEPS) if arguments.steps == "all" else arguments.steps.split(",")
        without_steps(names, seeds)
    else:
        without_constants(world.case(k, n) for k in arguments.kinds.split(",") for n in seeds)


if __name__ == "__main__":
    main()
