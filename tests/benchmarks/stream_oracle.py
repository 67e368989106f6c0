"""How soon any watch over hourly readings could tell a loss: an oracle that knows the world's law.

python tests/benchmarks/stream_oracle.py --seed 9200 --hangers 48 --knows temperature

The readings are those of `stream_trial.py`. What is off in a mode's log frequency, its known part
taken off, is Gaussian: the hourly error, the wander of the joints' seats of each plane, and that of
the tension by the warmth nobody records, by its spectrum; all of them exactly as the world draws
them. One Cholesky factor of their covariance over the weeks gives each hour's innovation, and the
likelihood ratio of a step at any hour since is a running sum. The oracle needs no learning, and
knows mistaken modes, the joints' slip, the clock, the wind and the mean of the traffic. Beside it
knows, as `--knows` has it:

- `weather`: all temperatures of the bridge.
- `temperature`: the recorded one. What that, its past and the time of day do not tell of the
  tension, by the coefficients of these very weeks, is a wander of known autocovariance.
- `variance`: the same, but of the wander only how large it is, as if it were the watch's own
  process of hours and days (`shm/watch/stream_filter.py`).

It rings where the Shiryaev-Roberts sum over all beginnings, of steps of normal size of 2 %, passes
50 years: under the law it does so at most 0.02 times a year (Pollak 1985). Beside it stands what
the limit costs that the watch keeps because its own law is none of the world's.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.worlds.living_bridge import Change  # noqa: E402
from tests.worlds.living_hourly import HourlyFlags, hourly_arrays  # noqa: E402
from tests.worlds.living_physics import DAY_S, YEAR_S, bridge, seconds  # noqa: E402

Array = NDArray[np.float64]

HOURS_A_YEAR = YEAR_S / 3600
PLAIN = HourlyFlags(
    scatter=False, swaps=False, gaps=False, quiet=False, temperature=False, outliers=False
)
LIMITS_YEARS = (50.0, 1e4)  # 0.02 a year; the watch's own 100, tempered by 100
KNOWN = ("weather", "temperature", "variance")
FAR_SD = 6.0  # no hourly error in these years is; a mistaken mode is
SIZE_SD = 0.02  # as of the watch's own steps
REGRESSED_DAYS = 90.0
KELVIN_LAGS_H = (1.0, 2.0, 4.0, 8.0, 14.0, 24.0, 48.0)


@dataclass(frozen=True, eq=False)
class Law:
    """Of N hours: `step` (rows, N) a unit of ln T from an hour on, whitened; `white` (rows,) what
    was read, likewise; `hour` (rows,) of which hour a row is."""

    step: Array
    white: Array
    hour: NDArray[np.int64]
    end_s: Array
    at_s: float


def covariance(shortest_s: float, longest_s: float, lags_s: Array) -> Array:
    """Of the world's sines, whose periods are spread evenly on a log scale; unit variance."""
    u = (np.arange(4000) + 0.5) / 4000
    period = shortest_s * (longest_s / shortest_s) ** u
    return np.cos(2 * np.pi * lags_s[:, None] / period).mean(axis=1)


def weather_unknown(b, h, t: Array) -> tuple[Array, Array]:
    """Of ln T: what the recorded temperature does not tell (N,), and its autocovariance (N,)."""
    around = np.arange(
        t[0] - REGRESSED_DAYS / 2 * DAY_S, t[-1] + REGRESSED_DAYS / 2 * DAY_S, 3600.0
    )
    w = b.weather(around[0] - 20 * DAY_S, around[-1] + 3600)
    arch, rod = w.of(f"arch{h.row}", around), w.of(f"rod{h.row}", around)
    parts = [w.of("deck", around), arch - w.of("deck", around),
             w.of("arch0", around) - w.of("arch1", around), rod - arch]  # fmt: skip
    true = h.thermal @ np.array(parts)
    lead = np.arange(around[0] - 15 * DAY_S, around[-1] + 1, 3600.0)
    seen = w.of("air", lead) + 0.4 * (w.of(f"rod{h.row}", lead) - w.of("air", lead))
    columns = [np.ones(len(around)), seen[-len(around) :]]
    for lag in KELVIN_LAGS_H:
        mean = np.empty_like(seen)
        mean[0], share = seen[0], -np.expm1(-1 / lag)
        for i in range(1, len(seen)):
            mean[i] = mean[i - 1] + share * (seen[i] - mean[i - 1])
        columns.append(mean[-len(around) :])
    daily = 2 * np.pi * around / DAY_S
    rounds = [f(n * daily) for n in range(1, 5) for f in (np.sin, np.cos)]
    kelvin = columns[1] - columns[-2]
    columns += rounds + [each * kelvin for each in rounds]
    design = np.array(columns).T
    design = np.column_stack([design, (around - around.mean()) / DAY_S])
    left = true - design @ np.linalg.lstsq(design, true, rcond=None)[0]
    n = len(t)
    own = np.array([left[: len(left) - k] @ left[k:] for k in range(n)]) / len(left)
    first = int(np.argmin(np.abs(around - t[0])))
    return left[first : first + n], own


def law(seed: int, size: float, knows: str) -> Law:
    """One hanger of `stream_trial.py`, with a loss of `size`."""
    draw = np.random.default_rng([seed, 77])
    number = int(draw.integers(1, 21))
    start = datetime(2024, 1, 1, tzinfo=UTC) + timedelta(days=float(draw.integers(0, 365)))
    at = start + timedelta(days=float(draw.uniform(15, 29)))
    years = ((at - start).total_seconds() / 86400 + 10.0) / 365.25  # the trial's: the same draws
    lost = [Change("tension_loss", number, at, size)] if size else []
    read = hourly_arrays(seed, number, years, lost, start=start)
    plain = hourly_arrays(seed, number, years, start=start, flags=PLAIN)
    unloaded = hourly_arrays(
        seed,
        number,
        years,
        start=start,
        flags=HourlyFlags(**{**PLAIN.__dict__, "live_load": False}),
    )
    b = bridge(seed, 20)
    h = b.hangers[number]
    t = read.time_s
    stop = int(np.searchsorted(t, seconds(at) + 1.2 * DAY_S))
    t, middle = t[:stop], t[:stop] + 1800
    slope = b.to_tension(number)[:, : read.frequency_hz.shape[2]]
    # ln f as it was read, less all that the oracle knows.
    live = b.live_road(number, middle)
    local = 0.5 * b._size(number) * (h.thermal[1] + h.thermal[3])
    tension = local * b._own(number, "local")(middle) - live
    lags = t - t[0]
    of_tension = local**2 * covariance(4 * 3600.0, 72 * 3600.0, lags)
    if knows != "weather":
        left, own = weather_unknown(b, h, middle)
        tension, of_tension = tension + left, of_tension + own
    if knows == "variance":
        past = lags / (1.3 * 3600)
        both = (1 + past) * np.exp(-past) + 0.25**2 * np.exp(-lags / (1.5 * DAY_S))
        of_tension = of_tension[0] * both
    seat = np.stack([h.wander[p] * b._own(number, f"seat{p}")(middle) for p in (0, 1)])
    y = np.log(read.frequency_hz[:stop] / unloaded.frequency_hz[:stop])
    sd = read.true_sd_hz[:stop] / read.true_hz[:stop]
    changed = ((t + 1800 >= seconds(at)) * size)[:, None, None]
    off = np.log(read.frequency_hz[:stop] / plain.frequency_hz[:stop]) + slope * changed
    wrong = np.abs(off) > FAR_SD * sd + 0.1 * changed
    y = y + slope * tension[:, None, None] + seat.T[:, :, None]
    known = np.isfinite(y) & ~wrong
    # Each hour: the modes of a plane say of (ln T, seat) what two numbers say.
    rows, design, hours = [], [], []
    for i in np.flatnonzero(known.any(axis=(1, 2))):
        p, k = np.nonzero(known[i])
        a = np.column_stack([slope[p, k], p == 0, p == 1]) / sd[i, p, k][:, None]
        q, r = np.linalg.qr(a) if len(p) > 3 else (np.eye(len(p)), a)
        rows.append(q.T @ (y[i, p, k] / sd[i, p, k]))
        design.append(r)
        hours += [i] * len(r)
    hour = np.array(hours)
    a = np.vstack(design)
    lag = np.abs(hour[:, None] - hour)
    cov = np.eye(len(hour)) + a[:, :1] * of_tension[lag] * a[:, 0]
    # The mean traffic of an hour is 0.5 to 1.5 of what is known, evenly.
    cov += a[:, :1] * (np.where(lag == 0, live[hour] ** 2 / 12, 0.0)) * a[:, 0]
    of_seat = covariance(1 * DAY_S, 60 * DAY_S, lags)[lag]
    for p in (0, 1):
        cov += h.wander[p] ** 2 * a[:, 1 + p : 2 + p] * of_seat * a[:, 1 + p]
    factor = cholesky(cov, lower=True)
    steps = a[:, :1] * (hour[:, None] >= np.arange(stop))
    both = solve_triangular(factor, np.column_stack([steps, np.concatenate(rows)]), lower=True)
    return Law(both[:, :-1], both[:, -1], hour, t + 3600, seconds(at))


def statistic(own: Law) -> Array:
    """Shiryaev-Roberts sum over all beginnings after each hour (N,), in years."""
    n = own.step.shape[1]
    last = np.searchsorted(own.hour, np.arange(n), side="right")
    score, information = (
        np.vstack([np.zeros((1, n)), np.cumsum(each, axis=0)])[last]
        for each in (own.step * own.white[:, None], own.step**2)
    )
    precision = information + 1 / SIZE_SD**2
    log_ratio = (score**2 / precision - np.log(SIZE_SD**2 * precision)) / 2
    begun = np.tri(n)  # a beginning after the hour is none
    return (np.exp(np.minimum(log_ratio, 300.0)) * begun).sum(axis=1) / HOURS_A_YEAR


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--hangers", type=int, default=12)
    parser.add_argument("--knows", default="temperature", help=", ".join(KNOWN))
    asked = parser.parse_args()
    seeds = range(asked.seed, asked.seed + asked.hangers)
    for knows in asked.knows.split(","):
        for size, hours in ((0.01, 24), (0.02, 6)):
            laws = [law(seed, size, knows) for seed in seeds]
            sums = [statistic(own) for own in laws]
            for limit in LIMITS_YEARS:
                told, unread, quiet, false = [], 0, 0.0, 0
                for own, found in zip(laws, sums, strict=True):
                    after = own.end_s > own.at_s
                    above = after & (found > limit)
                    delay_s = own.end_s[above.argmax()] - own.at_s if above.any() else np.inf
                    told.append(delay_s / 3600)
                    near = after & (own.end_s <= own.at_s + 3600 * hours)
                    unread += not np.isin(np.flatnonzero(near), own.hour).any()
                    quiet += float((~after).sum()) / HOURS_A_YEAR
                    false += bool((found[~after] > limit).any())
                late = [s for s, each in zip(seeds, told, strict=True) if each > hours]
                print(json.dumps({
                    "knows": knows, "loss": size, "hours": hours, "limit_years": limit,
                    "hangers": len(told), "told": len(told) - len(late), "unread": unread,
                    "median_hours": round(float(np.median(told)), 1),
                    "quiet_years": round(quiet, 2), "false": false, "late": late,
                }), flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
