"""The watch over hourly readings of permanent sensors, on a bridge that its author did not make.

python tests/benchmarks/stream_trial.py --scenario quiet --hangers 100 --years 1 --seed 1000
python tests/benchmarks/stream_trial.py --scenario loss1,loss2,ramp --hangers 40 --seed 1000
python tests/benchmarks/stream_trial.py --world road_bridge_hours --scenario end57,duty,silent

The world is `tests/worlds/living_bridge.py`: seasons, sun, wind, traffic, joints that slip, planes
exchanged, gaps; or `tests/worlds/road_bridge_hours.py`, with loggers that record six minutes of an
hour or fall silent for three months. Each hanger is of a bridge of its own and begins on a day of
its own. Of the scenarios quiet and silent all alerts are false. Elsewhere something comes after 15
to 29 days and is followed for ten days, a ramp for 40. Faults of sensors and clock are made here,
on the readings. Nothing was tuned on seeds from 1000 on.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from itertools import groupby
from pathlib import Path
from types import ModuleType
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from shm.monitor.sensor_health import SEEN_BEFORE, find_lost_planes  # noqa: E402
from shm.values import PLANES, Mode  # noqa: E402
from shm.values.rounding import NINETY_PERCENT  # noqa: E402
from shm.values.stream import (  # noqa: E402
    PooledReading,
    Stream,
    StreamChannel,
    StreamEvent,
    Window,
    WindowReading,
)
from shm.watch.engine.kept_state import to_bytes  # noqa: E402
from shm.watch.sensors.stream_reading import usable  # noqa: E402
from shm.watch.sensors.stream_watch import (  # noqa: E402
    HOURS_A_DAY,
    TOGETHER,
    StreamOptions,
    StreamState,
    StreamWatch,
    compensated,
    fraction_of,
)
from tests.benchmarks.stream_windows import hanger_of  # noqa: E402

WORLDS = ("living_bridge", "road_bridge_hours")
DAYS_A_YEAR = 365.25
HOUR = timedelta(hours=1)
OPPOSITE = {"transverse": "longitudinal", "longitudinal": "transverse"}


@dataclass(frozen=True)
class Scenario:
    """What comes: a change of the plant, or a fault of the readings."""

    plant: dict[str, Any] | None = None  # of the world's `Change`
    fault: Callable[[Mode, float], Mode | None] | None = None
    days_after: float = 10.0
    is_fault: bool = False
    louder: float = 1.0  # the level read, from then on
    loosens: float = 0.0  # an end, by this fraction of the first frequency
    minutes: float = 60.0  # of each hour
    silent_days: float = 0.0  # before it comes


def loss(size: float, over_days: float = 0.0) -> dict[str, Any]:
    return {"kind": "tension_loss", "size": size, "over_days": over_days}


def off_by(mode: Mode, fraction: float) -> Mode:
    return replace(mode, frequency_hz=mode.frequency_hz * (1 + fraction))


SCENARIOS = {
    "quiet": Scenario(),
    "loss1": Scenario(loss(0.01)),
    "loss2": Scenario(loss(0.02)),
    "loss6": Scenario(loss(0.06)),
    "ramp": Scenario(loss(0.02, 20.0), days_after=40.0),
    "ramp5": Scenario(loss(0.05, 30.0), days_after=40.0),
    "end": Scenario({"kind": "end_loosened", "size": 0.6}),
    "ice": Scenario({"kind": "ice", "size": 8.0, "over_days": 0.5}),
    "remounted": Scenario({"kind": "sensor_remounted", "size": 0.3}, is_fault=True),
    "clock": Scenario(fault=lambda mode, size: off_by(mode, 0.005 * size), is_fault=True),
    "swapped": Scenario(
        fault=lambda mode, _: replace(mode, plane=OPPOSITE[mode.plane]), is_fault=True
    ),
    "dead": Scenario(fault=lambda mode, _: None if mode.plane == "transverse" else mode,
                     is_fault=True),
    "gain": Scenario(louder=3.0, is_fault=True),
    "end57": Scenario(loosens=0.057),
    "duty": Scenario(loss(0.01), minutes=6.0),
    "duty_end57": Scenario(loosens=0.057, minutes=6.0),
    "silent": Scenario(days_after=30.0, silent_days=90.0),
    "silent_loss5": Scenario(loss(0.05), silent_days=90.0),
}  # fmt: skip


def as_reading(own: dict[str, Any]) -> PooledReading:
    modes = tuple(
        Mode(m["plane"], m["order"], m["frequency_hz"], m["frequency_sd_hz"], m["damping_ratio"])
        for m in own["modes"]
    )
    nan = float("nan")
    warm, wind = (nan if own[key] is None else own[key] for key in ("temperature_c", "wind_m_s"))
    level = float(np.median([m["level_m_s2"] for m in own["modes"]]))
    return PooledReading("a", own["hanger"], own["time"], "hour", modes, 6, 0, level, warm, wind)


def with_fault(
    readings: Sequence[PooledReading], scenario: Scenario, at: datetime, size: float
) -> Iterator[PooledReading]:
    for each in readings:
        if scenario.minutes < 60:
            each = replace(each, windows=1)
        if each.start >= at:
            each = replace(each, level_m_s2=each.level_m_s2 * scenario.louder)
        if scenario.fault is None or each.start < at:
            yield each
        else:
            found = [scenario.fault(mode, size) for mode in each.modes]
            yield replace(each, modes=tuple(mode for mode in found if mode))


def solved(world: ModuleType, name: str, seed: int, years: float) -> dict[str, Any]:
    """Run one hanger through one scenario."""
    scenario, draw = SCENARIOS[name], np.random.default_rng([seed, 77])
    number = int(draw.integers(1, 21))
    start = datetime(2024, 1, 1, tzinfo=UTC) + timedelta(days=float(draw.integers(0, 365)))
    at = start + timedelta(days=float(draw.uniform(15, 29)))
    size = float(draw.choice([-1, 1]) * draw.uniform(0.6, 1.5))
    silent_from, at = at, at + timedelta(days=scenario.silent_days)
    changes = [world.Change(hanger=number, at=at, **scenario.plant)] if scenario.plant else []
    if scenario.loosens:
        changes = [world.draw_loosening(seed, at, scenario.loosens)]
        number = changes[0].hanger
    if name != "quiet":
        years = ((at - start).total_seconds() / 86400 + scenario.days_after) / DAYS_A_YEAR
    logged = {}
    if scenario.minutes < 60 or scenario.silent_days:
        logged["logger"] = world.Logger(scenario.minutes, silent_from, scenario.silent_days)
    plain = world.hourly(seed, number, years, changes, start=start, **logged)
    readings = list(with_fault(list(map(as_reading, plain)), scenario, at, size))
    watch = StreamWatch(None, hanger_of(world.describe(seed, [number])[0]), StreamOptions())
    alerts, events, worst, state = [], [], 0.0, None
    windows: list[WindowReading] = []
    daily: list[tuple[datetime, float, float]] = []
    began = time.process_time()
    for _, group in groupby(readings, key=lambda each: each.start.date()):
        hours = list(group)
        for each in hours:
            events += with_lost_planes(windows, each, scenario.minutes)
            if not each.modes:
                continue
            found, state = watch.after(state, each)
            if found.test:
                worst = max(worst, found.test.change.evidence_years)
            if found.alert:
                alerts.append(found.alert)
            events += found.events
        if state and not state.is_learning and len(hours) > 12:
            daily.append((hours[0].start, *daily_shift(state, hours)))
    seconds = time.process_time() - began
    return {
        "scenario": name, "seed": seed, "hanger": number, "readings": len(readings),
        "years": years, "worst_years": worst, "ms": 1e3 * seconds / len(readings),
        "alerts": [
            {"hours": (a.time - at).total_seconds() / 3600, "kinds": a.kinds,
             "readings": sum(at - HOUR < each.start < a.time for each in readings),
             "time": f"{a.time:%Y-%m-%dT%H}", "message": a.message,
             "quantity": a.change.moved[0].quantity if a.change and a.change.moved else ""}
            for a in alerts
        ],
        "events": [{"hours": (e.end - at).total_seconds() / 3600, "kind": e.kind,
                    "detail": e.detail} for e in events],
        **daily_figures(world, seed, number, changes, start, daily, state),
        "state_bytes": len(to_bytes(state)) if state else 0,
    }  # fmt: skip


def with_lost_planes(
    windows: list[WindowReading], hour: PooledReading, minutes: float
) -> tuple[StreamEvent, ...]:
    """Add an hour to the windows of three days; return what the monitor says of planes first.

    An hour counts as one window: windows of ten minutes tell it after one hour, these after three.
    """
    before = list(windows)
    window = Window("a", hour.hanger, hour.start, 60 * minutes, "wind", hour.level_m_s2)
    windows.append(WindowReading(window, hour.modes, "tracked"))
    del windows[: -int(SEEN_BEFORE / HOUR)]
    channels = tuple(StreamChannel(plane[0], plane, 2.0, 20.0) for plane in PLANES)
    found = find_lost_planes(windows, Stream("a", hour.hanger, 100.0, channels))
    # One hour more of what was lost before is no news.
    earlier = find_lost_planes(before, Stream("a", hour.hanger, 100.0, channels))
    return tuple(e for e in found if e.channel not in {each.channel for each in earlier})


def daily_shift(state: StreamState, hours: Sequence[PooledReading]) -> tuple[float, float]:
    """Return the shift of the tension over a day since the stream's baseline, with its sd.

    The mean of the day's `hours`: the tension goes through the day by more than its mean is known
    to, and not all hours have all modes. Without corrections of the thermometer or the watch.
    """
    seen, between = [], state.contrast.along(compensated(state.contrast))
    for reading in hours:
        modes = usable(reading)
        known = [mode for mode in modes if (mode.plane, mode.order) in state.table.modes]
        if known:
            kelvin = float(np.nan_to_num(reading.temperature_c - state.reference[0]))
            seen.append(state.table.seen(known, kelvin, expected=between))
    if not seen:
        return np.nan, np.nan
    shifts, n = np.array([each.shift for each in seen]), len(seen)
    by_hour = float(np.mean([each.variance for each in seen])) / n
    # Hours that lack are as the others; some of them follow each other, and are as one.
    lacking = max(1 - n / HOURS_A_DAY, 0.0) * float(np.var(shifts)) * TOGETHER / n
    # Joints that seat anew and clocks keep 1.25e-4 of ln f for a day (judgement).
    day = 2 * 1.25e-4**2 / float(state.table.tension @ state.table.tension)
    sd = float(np.sqrt(by_hour + lacking + day))
    return fraction_of(float(shifts.mean()) - state.zero, sd, state.table)


def daily_figures(
    world: ModuleType,
    seed: int,
    number: int,
    changes: Sequence[Any],
    start: datetime,
    daily: Sequence[tuple[datetime, float, float]],
    state: StreamState | None,
) -> dict[str, Any]:
    """Coverage of the days' shifts of the tension, and how far they scatter about the truth."""
    if len(daily) < 3 or state is None:
        return {"covered": 0, "days": 0}
    hours = [timedelta(hours=h + 0.5) for h in range(24)]
    first = [start + each + timedelta(days=d) for d in range(3) for each in hours]
    base = world.true_tension(seed, number, first, changes).mean()
    true = np.array(
        [
            world.true_tension(seed, number, [day + h for h in hours], changes).mean()
            for day, *_ in daily
        ]
    )
    shift, sd = np.array([each[1:] for each in daily]).T
    off = shift - (true / base - 1)
    return {
        "covered": int((np.abs(off) < NINETY_PERCENT * sd).sum()),
        "days": len(daily),
        "repeatability": float(np.std(np.diff(off)) / np.sqrt(2)),
        "bias": float(off.mean()),
        "off_sd": float(off.std()),
        "stated_sd": float(np.median(sd)),
        "truth_sd": float(np.std(true / base)),
    }


def summary(name: str, found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    scenario, n = SCENARIOS[name], len(found)
    after = [[a for a in each["alerts"] if name == "quiet" or a["hours"] >= 0] for each in found]
    told = [min((a["hours"] for a in own), default=float("inf")) for own in after]
    figures: dict[str, Any] = {
        "scenario": name,
        "hangers": n,
        "hanger_years": sum(each["years"] for each in found),
        "alerts": sum(map(len, after)),
        "false_before": sum(len(each["alerts"]) for each in found) - sum(map(len, after)),
        "events": sum(len(each["events"]) for each in found),
        "days_covered": sum(e["covered"] for e in found) / max(sum(e["days"] for e in found), 1),
        "repeatability": float(np.median([e.get("repeatability", np.nan) for e in found])),
        "repeatability_worst": float(np.max([e.get("repeatability", np.nan) for e in found])),
        "ms_a_reading": float(np.mean([each["ms"] for each in found])),
        "state_bytes": max(each["state_bytes"] for each in found),
    }
    if scenario.is_fault:
        figures["told_as_tension"] = sum(
            any("tension" in a["message"].partition(". ")[0] for a in own) for own in after
        )
        figures["named"] = sum(any(e["hours"] >= 0 for e in each["events"]) for each in found)
    elif name != "quiet":
        for hours in (6, 12, 24, 72, 240, 960):
            figures[f"within_{hours}_h"] = sum(t <= hours for t in told) / n
        read = [min((a["readings"] for a in own), default=n * 10**6) for own in after]
        for count in (6, 24):
            figures[f"within_{count}_readings"] = sum(r <= count for r in read) / n
        figures["as_tension"] = (
            sum(bool(own) and own[0]["quantity"] == "tension" for own in after) / n
        )
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--world", default=WORLDS[0], choices=WORLDS)
    parser.add_argument("--scenario", default="quiet", help=", ".join(SCENARIOS))
    parser.add_argument("--hangers", type=int, default=20)
    parser.add_argument("--years", type=float, default=1.0, help="of the quiet scenario")
    parser.add_argument("--seed", type=int, default=0, help="of the first hanger's bridge")
    parser.add_argument("--json", type=Path, help="all that was found")
    asked = parser.parse_args()
    every = []
    world = importlib.import_module(f"tests.worlds.{asked.world}")
    for name in asked.scenario.split(","):
        found = []
        for seed in range(asked.seed, asked.seed + asked.hangers):
            found.append(solved(world, name, seed, asked.years))
            each = found[-1]
            print(
                name, seed, f"{each['worst_years']:.2g} years", f"bias {each.get('bias', 0):.1e}",
                *(f"{a['hours']:.0f} h {a['message'][:70]}" for a in each["alerts"]),
                *(f"[{e['hours']:.0f} h {e['detail'][:50]}]" for e in each["events"]),
                file=sys.stderr, flush=True,
            )  # fmt: skip
        every += found
        print(json.dumps(summary(name, found), indent=1), flush=True)
    if asked.json:
        asked.json.write_text(json.dumps(every, default=str))


if __name__ == "__main__":
    main()
