"""Windows of permanent sensors, tracked and pooled, on a living bridge that somebody else made.

    python tests/benchmarks/stream_windows.py --seeds 6 --seed 1000 --hours 6
    python tests/benchmarks/stream_windows.py --seeds 2 --seed 1000 --hours 24

The records are those of `tests/worlds/living_bridge.py`, two hangers a seed, all nuisances on.
Known at the beginning are the modes that the first usable window gives `from scratch`; then each
window's modes are those of the next. Truth is the frequency at small amplitude under the mean load
of cars and lorries: softening joints are part of the bias that is printed.
"""

from __future__ import annotations

import os
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from tests.benchmarks import begin

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from shm.identify import IdentifyOptions  # noqa: E402
from shm.monitor import pooled, read_window  # noqa: E402
from shm.values import Hanger, Mode  # noqa: E402
from shm.values.stream import (  # noqa: E402
    PERIODS,
    Piece,
    PooledReading,
    Stream,
    StreamChannel,
    WindowReading,
)
from tests.worlds import living_bridge as world  # noqa: E402
from tests.worlds import living_physics  # noqa: E402

START = datetime(2026, 5, 4, 6, tzinfo=UTC)
WINDOW = timedelta(minutes=10)
HIGHEST_HZ = 40.0
LEAST_WINDOWS = 10
WITHIN = 1.645  # of a 90 % interval


@dataclass
class Score:
    """What is counted; `errors` by kind: (relative error, error over its standard deviation).

    `series` by mode: (relative error, standard deviation) of its windows.
    """

    kinds: Counter[str] = field(default_factory=Counter)
    why: Counter[str] = field(default_factory=Counter)
    followed: list[float] = field(default_factory=list)
    swaps: int = 0
    seconds: list[float] = field(default_factory=list)
    errors: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    series: dict[Any, list[tuple[float, float]]] = field(default_factory=dict)

    def compare(self, kind: str, modes: Sequence[Mode], true: dict[str, Any]) -> None:
        every = np.concatenate(list(true.values()))
        for mode in modes:
            own = true[mode.plane]
            if mode.order > len(own):
                self.swaps += 1
                continue
            hz = own[mode.order - 1]
            nearest = every[np.argmin(np.abs(every - mode.frequency_hz))]
            off = mode.frequency_hz - hz
            if nearest != hz and abs(off) > 5 * mode.frequency_sd_hz:
                self.swaps += abs(nearest / mode.frequency_hz - 1) < 0.2 * abs(off / hz)
            z = off / mode.frequency_sd_hz
            self.errors.setdefault(kind, []).append((off / hz, z))

    def said(self) -> str:
        lines = [
            f"windows {dict(self.kinds)}",
            f"followed {np.mean(self.followed):.3f} of the known modes; exchanged {self.swaps}; "
            f"processor {np.median(self.seconds):.3f} s a window (90 %: "
            f"{np.quantile(self.seconds, 0.9):.3f})",
        ]
        for kind, errors in self.errors.items():
            off, z = np.array(errors).T
            lines.append(
                f"{kind}: {len(z)} modes, median bias {np.median(off):+.1e}, median |error| "
                f"{np.median(np.abs(off)):.1e}, |z| < {WITHIN}: {np.mean(np.abs(z) < WITHIN):.3f}, "
                f"scatter of z {1.4826 * np.median(np.abs(z)):.2f}, beyond 5: "
                f"{np.mean(np.abs(z) > 5):.4f}"
            )
        lines.append(f"what repeats in a mode's windows: {self.repeats():.1e}")
        lines += [f"  {count} x {why}" for why, count in self.why.most_common(8)]
        return "\n".join(lines)

    def repeats(self) -> float:
        """Robust standard deviation of the modes' mean errors, chance taken out."""
        long = [np.array(own) for own in self.series.values() if len(own) >= LEAST_WINDOWS]
        mean = [np.mean(own[:, 0]) for own in long]
        chance = [np.sqrt(np.mean(own[:, 1] ** 2) / len(own)) for own in long]
        usual = 1.4826 * np.median(np.abs(mean))
        return float(np.sqrt(max(0.0, usual**2 - np.median(chance) ** 2)))


def hanger_of(entry: dict[str, Any]) -> Hanger:
    """The hanger as its owner describes it."""
    return Hanger(
        id=entry["id"],
        length_m=entry["length_m"],
        elastic_modulus_pa=entry["elastic_modulus_pa"],
        area_m2=entry["area_m2"],
        second_moment_m4=entry["second_moment_m4"],
        mass_per_length_kg_m=entry["mass_kg_m"],
        nominal_tension_n=entry["nominal_tension_n"],
        diameter_m=entry["diameter_m"],
        kind=entry["kind"],
    )


def described(entry: dict[str, Any]) -> tuple[Hanger, Stream]:
    channels = tuple(
        StreamChannel(each["channel"], each["plane"], each["x_m"]) for each in entry["sensors"]
    )
    return hanger_of(entry), Stream(entry["stream"], entry["id"], world.RATE_HZ, channels)


def windows(
    seed: int, hangers: Sequence[int], hours: float
) -> Iterator[tuple[int, datetime, list[Piece]]]:
    """Hanger, begin and pieces of each window that is complete; a lost chunk leaves a gap."""
    kept: dict[tuple[int, int], dict[int, dict[str, Any]]] = {}
    last = 0
    for chunk in world.raw(seed, hangers, START, hours):
        minute = round((datetime.fromisoformat(chunk["time"]) - START) / timedelta(minutes=1))
        kept.setdefault((minute // 10, chunk["hanger"]), {})[minute] = chunk
        if minute // 10 > last + 1:
            for key in sorted(each for each in kept if each[0] <= last):
                yield key[1], START + key[0] * WINDOW, list(_pieces(kept.pop(key)))
            last += 1
    for key in sorted(kept):
        yield key[1], START + key[0] * WINDOW, list(_pieces(kept[key]))


def _pieces(chunks: dict[int, dict[str, Any]]) -> Iterator[Piece]:
    run: list[dict[str, Any]] = []
    for minute in sorted(chunks):
        if run and minute - 1 not in chunks:
            yield _piece(run)
            run = []
        run.append(chunks[minute])
    yield _piece(run)


def _piece(run: Sequence[dict[str, Any]]) -> Piece:
    values = np.concatenate([chunk["values"] for chunk in run], axis=1).astype(float)
    conditions = [
        float(np.mean([c[name] if c[name] is not None else np.nan for c in run]))
        for name in ("temperature_c", "wind_m_s")
    ]
    first = run[0]
    begin = datetime.fromisoformat(first["time"])
    names = tuple(first["channels"])
    return Piece(first["stream"], begin, world.RATE_HZ, names, values, *conditions)


def true_hz(seed: int, hanger: int, times: Sequence[datetime]) -> dict[str, Any]:
    """Mean over times, under the mean load of cars and lorries: they do not go away."""
    bridge = living_physics.bridge(seed, 20)
    seconds = [living_physics.seconds(each) for each in times]
    live = bridge.live_road(hanger, seconds)
    hz = bridge.frequencies(hanger, seconds, live=live).mean(axis=0)
    return dict(zip(world.PLANES, hz, strict=True))


def followed(
    seed: int, hangers: Sequence[int], hours: float, score: Score
) -> dict[int, list[WindowReading]]:
    """All windows of these hangers, each read by what the one before left known."""
    sites = {each["id"]: described(each) for each in world.describe(seed, hangers)}
    known: dict[int, dict[tuple[str, int], Mode]] = {h: {} for h in hangers}
    found: dict[int, list[WindowReading]] = {h: [] for h in hangers}
    options = IdentifyOptions(band_high_hz=HIGHEST_HZ)
    for h, start, pieces in windows(seed, hangers, hours):
        before = tuple(known[h].values())
        begun = time.process_time()
        reading = read_window(pieces, sites[h][1], before, sites[h][0], options)
        if reading.how == "tracked":
            score.seconds.append(time.process_time() - begun)
        score.kinds[f"{reading.window.kind}, {reading.how}"] += 1
        for part in reading.why.split("; "):
            score.why[part.split(":")[0] if "set apart" not in part else "set apart"] += 1
        if before and reading.window.kind != "unusable":
            score.followed.append(len(reading.modes) / len(before))
        times = [start + part * WINDOW for part in (0.2, 0.5, 0.8)]
        true = true_hz(seed, h, times)
        score.compare(reading.how, reading.modes, true)
        if reading.how == "tracked":
            for mode in reading.modes:
                hz, key = true[mode.plane][mode.order - 1], (seed, h, mode.plane, mode.order)
                pair = mode.frequency_hz / hz - 1, mode.frequency_sd_hz / hz
                score.series.setdefault(key, []).append(pair)
        known[h] |= {(m.plane, m.order): m for m in reading.modes}
        found[h].append(reading)
    return found


def pool(seed: int, readings: dict[int, list[WindowReading]], score: Score, hours: float) -> None:
    for h, own in readings.items():
        for period, length in PERIODS.items():
            for step in range(int(timedelta(hours=hours) / length)):
                reading: PooledReading | None = pooled(own, period, START + step * length)
                if reading is None:
                    continue
                times = [
                    START + step * length + length * part for part in (np.arange(12) + 0.5) / 12
                ]
                score.compare(period, reading.modes, true_hz(seed, h, times))


def main() -> int:
    given = begin.options(__doc__, seeds=2, seed=0, hours=2.0)
    score = Score()
    for seed in range(given.seed, given.seed + given.seeds):
        draw = np.random.default_rng([seed, 32])
        hangers = sorted(draw.choice(np.arange(1, 21), 2, replace=False).tolist())
        readings = followed(seed, hangers, given.hours, score)
        pool(seed, readings, score, given.hours)
        print(f"seed {seed}: hangers {hangers}", file=sys.stderr, flush=True)
    print(score.said())
    return 0


if __name__ == "__main__":
    sys.exit(main())
