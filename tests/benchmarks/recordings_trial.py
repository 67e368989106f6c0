"""How well `identify` reads recordings of a world that was made without regard to it.

    python tests/benchmarks/recordings_trial.py --kinds softening,taps --seeds 0:6 --answers a.jsonl

Each recording of `tests/worlds/recordings.py` goes through `identify` as a user's file would: with
its channels' planes, places and full scales, the hanger's description with a nominal tension that
is 10 % off (standard deviation), and the settings' defaults. Only what tests differ by
(`frequency_allowance`) is left out: within one recording nothing could cover it.

Frequencies are judged by those of small amplitude, as the file's own clock shows them. A mode is to
be found where it is 20 dB above the rest at its best sensor, in the band, and in a plane that the
channels are said to measure; those of refused tests count as missed. A mode whose order, or
plane, is said to be unknown is found and counted apart, too. A wrong name is a mode of the
structure under another plane or order; where no bar is (kinds `any_...`) names mean nothing.
Of the modes to be found, those that anybody could identify (`recordings_limit`) are counted apart.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tests.benchmarks import begin

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from shm.errors import ShmError
from shm.identify import Identification, IdentifyOptions, identify
from shm.report.shared_tables import overall
from shm.values import PLANES, Channel, Hanger, Mode, Recording
from tests.benchmarks.recordings_limit import bounds
from tests.worlds import recordings as world
from tests.worlds.recorded_kinds import KINDS
from tests.worlds.recorded_structures import POISSON, STEEL_KG_M3, STEEL_PA

LEAST_SNR_DB = 20.0
SAME_MODE = 0.005
"""Relative: beyond what softening moves a frequency, below what two modes of a plane differ by."""
NOMINAL_OFF = 0.1
NINETY = 1.645
COLUMNS = (
    "kind", "tests", "refused", "found", "%", "of identifiable", "%", "unnumbered",
    "wrong names", "of them Good",
    "false", "of modes", "frequency covered", "damping covered", "CPU s",
)  # fmt: skip


@dataclass
class Answer:
    """What one recording gave. `frequency_z`, `damping_z`: errors over standard deviations."""

    kind: str
    seed: int
    refused: str = ""
    verdict: str = ""
    seconds: float = 0.0
    expected: int = 0
    found: int = 0
    identifiable: int = 0
    identified: int = 0
    unnumbered: int = 0
    reported: int = 0
    wrong: int = 0
    false: int = 0
    frequency_z: list[float] = field(default_factory=list)
    damping_z: list[float] = field(default_factory=list)
    not_good: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


def as_record(case: world.Recording) -> Recording:
    """The recording as `shm.read` would give it, in SI units."""
    channels = []
    for channel, values in zip(case.channels, case.data.T, strict=True):
        unit = world.G if channel.unit == "g" else 1.0
        plane: Any = channel.plane if channel.plane in PLANES else None
        place_m = np.nan if channel.place_m is None else channel.place_m
        scale = channel.full_scale * unit
        channels.append(
            Channel(channel.name, channel.quantity, values * unit, plane, place_m, scale)
        )
    return Recording(
        source=f"{case.kind}-{case.seed}.csv",
        channels=tuple(channels),
        sampling_rate_hz=case.rate_hz,
        time=case.start,
        temperature_c=case.temperature_c,
    )


def described(case: world.Recording) -> Hanger:
    """The hanger as its owner describes it: what is no bar as a structure of any kind."""
    told = case.truth.description
    if not told:
        return Hanger.without_model(1)
    area = np.pi / 4 * told["diameter_m"] ** 2
    moment = np.pi / 64 * told["diameter_m"] ** 4
    off = 1 + NOMINAL_OFF * float(np.random.default_rng(case.seed).standard_normal())
    return Hanger(
        id=1,
        length_m=told["length_m"],
        elastic_modulus_pa=STEEL_PA,
        area_m2=area,
        second_moment_m4=moment,
        mass_per_length_kg_m=STEEL_KG_M3 * area,
        nominal_tension_n=told["tension_n"] * off,
        diameter_m=told["diameter_m"],
        poissons_ratio=POISSON,
    )


def answered(kind: str, seed: int) -> Answer:
    """Draws, identifies and judges one recording."""
    case = world.case(kind, seed)
    answer = Answer(kind, seed)
    record, hanger = as_record(case), described(case)
    began = time.process_time()
    found: Identification | None = None
    try:
        found = identify([record], IdentifyOptions(), test_id=record.source, hanger=hanger)
    except ShmError as error:
        answer.refused = str(error)
    answer.seconds = time.process_time() - began
    if found is not None:
        answer.verdict = overall(found.quality)
        answer.not_good = [
            f"{check.name}: {check.verdict}" for check in found.quality if check.verdict != "good"
        ]
    _judge(answer, case, list(_told(found)) if found else [])
    if found is not None:
        answer.remarks += [
            f"aside: {m.kind} {m.frequency_hz:.3f} Hz, {m.reason}" for m in found.set_aside
        ]
    return answer


def _told(found: Identification) -> Iterator[Mode]:
    """All that are told as modes; an order that is not known is 0, a plane None."""
    yield from found.test.modes
    for each in found.set_aside:
        if each.kind == "unnumbered":
            plane: Any = each.plane
            yield Mode(
                plane, 0, each.frequency_hz, each.frequency_sd_hz,
                each.damping_ratio, each.damping_sd,
            )  # fmt: skip


def _judge(answer: Answer, case: world.Recording, modes: list[Mode]) -> None:
    clock = 1 + case.truth.time_base_error
    planes = {channel.plane for channel in case.channels if channel.quantity == "acceleration"}
    options = IdentifyOptions()
    answer.reported = len(modes)
    limits = {id(mode): limit for mode, limit in zip(case.truth.modes, bounds(case), strict=True)}
    for truth in sorted(case.truth.modes, key=lambda mode: -mode.snr_db):
        shown_hz = truth.frequency_hz / clock
        own = _own(modes, truth, shown_hz, named=bool(case.truth.description))
        heard = truth.snr_db >= LEAST_SNR_DB and truth.plane in planes
        if heard and options.band_low_hz <= shown_hz <= options.band_high_hz:
            limit = limits[id(truth)]
            answer.expected += 1
            answer.found += own is not None
            answer.identifiable += limit.identifiable
            answer.identified += limit.identifiable and own is not None
            answer.unnumbered += own is not None and not own.order
            if own is None:
                why = "" if limit.identifiable else ", as anybody would"
                answer.remarks.append(f"missed {_words(truth, shown_hz)}{why}")
        if own is not None:
            modes.remove(own)
            _errors(answer, truth, shown_hz, own)
    for mode in modes:
        near = [t for t in case.truth.modes if _same(mode.frequency_hz, t.frequency_hz / clock)]
        told = f"{mode.plane} {mode.order} {mode.frequency_hz:.4f} Hz z {mode.damping_ratio:.5f}"
        if near:
            answer.wrong += 1
            nearest = min(near, key=lambda t: abs(t.frequency_hz / clock - mode.frequency_hz))
            words = _words(nearest, nearest.frequency_hz / clock)
            answer.remarks.append(f"wrong name {told}, is {words}")
        else:
            answer.false += 1
            answer.remarks.append(f"false {told}")


def _own(
    modes: Sequence[Mode], truth: world.ModeTruth, shown_hz: float, *, named: bool
) -> Mode | None:
    """The reported mode that is this one, by name and frequency; by frequency where no bar is."""
    near = [
        mode
        for mode in modes
        if _same(mode.frequency_hz, shown_hz)
        and (not named or (mode.plane in (None, truth.plane) and mode.order in (0, truth.order)))
    ]
    return min(near, key=lambda m: (not m.order, abs(m.frequency_hz - shown_hz)), default=None)


def _same(one_hz: float, other_hz: float) -> bool:
    return abs(one_hz / other_hz - 1) < SAME_MODE


def _words(truth: world.ModeTruth, shown_hz: float) -> str:
    return (
        f"{truth.plane} {truth.order} {shown_hz:.4f} Hz z {truth.damping_ratio:.5f} "
        f"{truth.snr_db:.0f} dB"
    )


def _errors(answer: Answer, truth: world.ModeTruth, shown_hz: float, mode: Mode) -> None:
    z = (mode.frequency_hz - shown_hz) / mode.frequency_sd_hz
    answer.frequency_z.append(z)
    damping_z = (mode.damping_ratio - truth.damping_ratio) / mode.damping_sd
    if np.isfinite(damping_z):
        answer.damping_z.append(damping_z)
    if abs(z) > NINETY or abs(damping_z) > NINETY:
        answer.remarks.append(
            f"off {_words(truth, shown_hz)}: {mode.frequency_hz / shown_hz - 1:+.5%} (z {z:+.1f}), "
            f"damping {mode.damping_ratio / truth.damping_ratio - 1:+.1%} (z {damping_z:+.1f})"
        )


def rows(answers: Sequence[Answer]) -> Iterator[tuple[str, ...]]:
    """One row a kind, and one of all."""
    for kind in dict.fromkeys(answer.kind for answer in answers):
        yield _row(kind, [answer for answer in answers if answer.kind == kind])
    yield _row("all", answers)


def _row(name: str, answers: Sequence[Answer]) -> tuple[str, ...]:
    expected, found = sum(a.expected for a in answers), sum(a.found for a in answers)
    identifiable = sum(a.identifiable for a in answers)
    identified = sum(a.identified for a in answers)
    return (
        name,
        str(len(answers)),
        str(sum(bool(a.refused) for a in answers)),
        f"{found}/{expected}",
        f"{100 * found / expected:.1f}" if expected else "-",
        f"{identified}/{identifiable}",
        f"{100 * identified / identifiable:.1f}" if identifiable else "-",
        str(sum(a.unnumbered for a in answers)),
        str(sum(a.wrong for a in answers)),
        str(sum(a.wrong for a in answers if a.verdict == "good")),
        str(sum(a.false for a in answers)),
        str(sum(a.reported for a in answers)),
        _coverage([z for a in answers for z in a.frequency_z]),
        _coverage([z for a in answers for z in a.damping_z]),
        f"{np.mean([a.seconds for a in answers]):.2f}",
    )


def _coverage(z: Sequence[float]) -> str:
    return f"{np.mean(np.abs(z) <= NINETY):.2f} of {len(z)}" if z else "-"


def main() -> None:
    arguments = begin.options(
        __doc__,
        kinds=begin.Told(",".join(KINDS), "names, parted by commas"),
        seeds=begin.Told("0:6", "first:end"),
        answers=begin.Told(Path, "a line of JSON for each recording"),
    )
    first, end = (int(part) for part in arguments.seeds.split(":"))
    answers = []
    lines = arguments.answers.open("w") if arguments.answers else None
    for kind in arguments.kinds.split(","):
        for seed in range(first, end):
            answers.append(answered(kind, seed))
            if lines:
                lines.write(json.dumps(asdict(answers[-1])) + "\n")
                lines.flush()
    if lines:
        lines.close()
    grid = Table(*COLUMNS)
    for row in rows(answers):
        grid.add_row(*row)
    Console(width=200, highlight=False).print(grid)


if __name__ == "__main__":
    main()
