"""Bridges whose logger's clock fails just when a hanger loses a tenth of its tension."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from shm.documents import dump
from shm.modes_document import modes_document
from shm.store.recordings import list_holds
from shm.values import Hanger, ModalTest
from tests.helpers.flows import Clock, a_flow, receive_all
from tests.helpers.workspaces import START, make_workspace, modes_of, put

SECOND, HOUR, DAY = timedelta(seconds=1), timedelta(hours=1), timedelta(days=1)
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
SPACINGS = (DAY, 30 * DAY, 180 * DAY)
"""Tests hours apart are no trial of the clock: the watch counts its evidence in years, and with a
right clock it calls nothing within hours of the baseline either."""
LOST = 0.9
FREQUENCY_SD = 1e-3
PER_KELVIN = -2e-4  # of a frequency: a tension that goes with the temperature

Told = Callable[[datetime, int, datetime, int], datetime]
FAULTS: dict[str, Told] = {
    # The true time, which faulty test it is, the last good test's time, and a sign.
    "epoch": lambda time, number, last, sign: EPOCH + number * HOUR,
    "day off": lambda time, number, last, sign: time + sign * DAY,
    "stuck": lambda time, number, last, sign: last,
    "summer time": lambda time, number, last, sign: time + sign * HOUR,
    "hardly moves": lambda time, number, last, sign: last + (number + 1) * SECOND,
    "out of order": lambda time, number, last, sign: last + (time - last) / (4 if number else 1),
    "first at epoch": lambda time, number, last, sign: time if number else EPOCH,
    "second at epoch": lambda time, number, last, sign: EPOCH if number else time,
    "anywhere": lambda time, number, last, sign: (
        last + (time - last) * sign * ((time.microsecond + 617 * number) % 1000) / 1000
    ),
}


@dataclass(frozen=True)
class Outcome:
    """Whether anything was told by the second lost test, and how many good ones were held."""

    told: bool
    good_held: int


def one_case(fault: str, seed: int, folder: Path) -> Outcome:
    """A baseline, up to three good tests, then two of a tenth less, with the clock at fault."""
    rng = np.random.default_rng(seed)
    workspace = make_workspace(folder / f"{fault.replace(' ', '-')}-{seed}")
    good, spacing = 1 + int(rng.integers(4)), SPACINGS[rng.integers(len(SPACINGS))]
    sign, first = int(rng.choice([-1, 1])), START + float(rng.uniform(0, 300)) * DAY
    clock, hanger = Clock(first), workspace.bridge.hangers[0]
    with a_flow(workspace, clock=clock) as flow:
        for number in range(good + 2):
            time, lost = first + number * spacing, number >= good
            clock.now = time + HOUR / 2
            last = first + (good - 1) * spacing
            told = FAULTS[fault](time, number - good, last, sign) if lost else time
            test = _test(f"t{number}", hanger, LOST if lost else 1.0, told, rng)
            put(workspace.spool / f"t{number}.modes.json", dump(modes_document([test])))
            receive_all(flow)
            flow.drain()
            if number == good - 1:
                held = len(list_holds(flow.store))
        return Outcome(bool(flow.store.alerts.list_all()), held)


def _test(
    name: str, hanger: Hanger, tension: float, time: datetime, rng: np.random.Generator
) -> ModalTest:
    temperature_c = float(rng.normal(12, 6))
    by_warmth = 1 + PER_KELVIN * (temperature_c - 12)
    noise = np.exp(FREQUENCY_SD * rng.standard_normal(12)) * by_warmth
    modes = tuple(
        replace(mode, frequency_hz=hz, frequency_sd_hz=FREQUENCY_SD * hz)
        for mode, factor in zip(modes_of(hanger, tension), noise, strict=True)
        for hz in [mode.frequency_hz * float(factor)]
    )
    return ModalTest(name, modes, hanger.id, time, temperature_c)
