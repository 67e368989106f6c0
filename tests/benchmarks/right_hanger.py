"""Is another hanger's test doubted, and is the right one's not? On truth of the two worlds.

python tests/benchmarks/right_hanger.py                       # a look
python tests/benchmarks/right_hanger.py --bridges 30 --seed 91

Bridges of 20 hangers, composed of what `tests/worlds` make: lengths along a parabola, one or two
diameters, rods or strands, one or two arches (so that each hanger has one or three twins by its
drawing), ends of one kind with their scatter, tensions 10 % about the nominal ones. Every hanger
has a history of 0, 1 or 5 tests with temperatures, remounted sensors and missing modes. Then comes
one test more: its own, sound or really changed; another hanger's; its own at a wrong sampling rate.

Pairs that nobody can tell apart are counted by themselves: those whose exact frequencies are the
same within three standard deviations of a test once the tension is allowed to differ by a quarter.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import sys
import tempfile
import time
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.stats import beta

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import shm
from shm.plausibility.bars import Known, doubt_of
from shm.values import PLANES, ModalTest, Mode

fe: Any = importlib.import_module("tests.worlds.finite_elements")
spectral: Any = importlib.import_module("tests.worlds.spectral")

HANGERS, ASKED, MOST_ORDERS = 20, 10, 12
"""Hangers of a bridge, of how many tests are filed, modes of a plane."""
TENSIONS = np.array([0.7, 0.8, 0.9, 1.0, 1.1])
"""Of the true one, at which frequencies are solved; between them ln f is a cubic in ln T."""

HISTORIES = ((0, 0), (0, 5), (1, 1), (5, 5))
"""Earlier tests of the named hanger, and of every other."""

FACTORS = (2.0, 0.5, 1.024, 1000 / 1024, 0.1)
CHANGES = ("none", "-5 %", "-10 %", "-20 %", "lamp", "softer end", "mistaken order", "few modes")


@dataclass
class Truth:
    """One hanger: its description, and ln f (planes, orders) as polynomials in ln T."""

    hanger: Any
    polynomial: np.ndarray  # (degree + 1, 2, orders)
    lamp: np.ndarray  # ln f with 8 kg (2, orders)
    softer: np.ndarray
    orders: int
    whole_kg: float
    sensor_kg: float
    repeat: np.ndarray

    def log_f(self, log_tension: float) -> np.ndarray:
        powers = log_tension ** np.arange(len(self.polynomial))[::-1]
        return np.asarray(np.tensordot(powers, self.polynomial, 1))


@dataclass
class Bridge:
    hangers: list[Truth]
    planes: tuple[str, ...]
    scatter: float
    stated: float
    per_k: float


def by_finite_elements(rng: Any, plan: dict[str, Any]) -> Any:
    """A function that gives ln f (tensions, 2, orders) of a hanger of that world, and its mass."""
    length, area, modulus = plan["length"], plan["area"], plan["modulus"]
    own_area = area * (1 + 0.01 * rng.standard_normal())
    own_modulus = modulus * (1 + 0.015 * rng.standard_normal())
    density = plan["density"] * (1 + 0.003 * rng.standard_normal())
    own_length = length * (1 + 0.0005 * rng.standard_normal())
    moment = plan["moment"] * (own_area / area) ** 2
    bending = plan["slip"] * own_modulus * moment
    mass = density * own_area
    springs = np.array(plan["springs"]) * np.exp(0.4 * rng.standard_normal(4))
    springs = springs.clip(0.03, 1000) * bending / own_length
    shear = fe.COWPER_ROUND * own_modulus / (2 * (1 + fe.POISSON)) * own_area
    place = min(float(rng.uniform(1.0, 2.5)), 0.45 * own_length)
    lamp_at = own_length * float(rng.uniform(0.15, 0.85))
    bare = fe.Bar(
        length_m=own_length,
        tension_n=plan["tension"],
        bending_stiffness_n_m2=bending,
        mass_per_length_kg_m=mass,
        shear_stiffness_n=shear if plan["rod"] else np.inf,
        rotary_inertia_kg_m=density * moment,
        tension_gradient_n_m=mass * fe.GRAVITY_M_S2,
        masses=((place, plan["sensor"]),),
    )

    def solve(tensions: Any, lamp: bool = False, softer: bool = False) -> np.ndarray:
        rows = []
        for factor in tensions:
            both = []
            for deck, arch in ((0, 2), (1, 3)):
                bar = replace(
                    bare,
                    tension_n=factor * plan["tension"],
                    spring_deck_n_m_rad=springs[deck] / (3 if softer else 1),
                    spring_arch_n_m_rad=springs[arch],
                    masses=(*bare.masses, *([(lamp_at, 8.0)] if lamp else [])),
                )
                both.append(fe.natural_frequencies_hz(bar, MOST_ORDERS, elements=7))
            rows.append(both)
        return np.log(rows)

    return solve, mass * own_length


def by_spectral(rng: Any, plan: dict[str, Any]) -> Any:
    """The same of the other world: end zones, a section that wanders, flexible supports."""
    length, area, modulus = plan["length"], plan["area"], plan["modulus"]
    own_area = area * (1 + 0.01 * rng.standard_normal())
    own_modulus = modulus * (1 + 0.015 * rng.standard_normal())
    density = plan["density"] * (1 + 0.003 * rng.standard_normal())
    own_length = length * (1 + 0.0005 * rng.standard_normal())
    moment = plan["moment"] * (own_area / area) ** 2
    mass = density * own_area
    bending = plan["slip"] * own_modulus * moment
    shear = spectral.SHEAR_FACTOR * own_modulus * own_area / (2 + 2 * spectral.POISSON)
    wander = spectral._wander(rng, own_length, 0.003, 0.2)
    zones = tuple(spectral.EndZone(z * length, *plan["zone"][1:]) for z in plan["zone"][0])
    place = min(float(rng.uniform(1.0, 2.2)), 0.4 * own_length)
    lamp_at = own_length * float(rng.uniform(0.15, 0.85))
    unit = bending / own_length
    kind = plan["kind"]
    deck = spectral._draw_end(rng, kind, kind.deck_style, unit)
    arch = spectral._draw_end(rng, kind, kind.arch_style, unit)
    soft = [10 ** float(rng.uniform(-9, -8)) for _ in range(4)]
    bar = spectral.Bar(
        own_length, mass, bending, shear, mass * moment / own_area, wander, zones, True,
        plan["sensor"], place,
    )  # fmt: skip

    def solve(tensions: Any, lamp: bool = False, softer: bool = False) -> np.ndarray:
        # The lamp is the sensor's point mass made heavier and moved: one mass is all it can carry.
        own = replace(bar, sensor_kg=8.0, sensor_at_m=lamp_at) if lamp else bar
        both = []
        for at in (0, 1):
            ends = (
                spectral.End(deck[at] / (3 if softer else 1), soft[at]),
                spectral.End(arch[at], soft[2 + at]),
            )
            forces = [float(factor * plan["tension"]) for factor in tensions]
            both.append(spectral.natural_frequencies_hz(own, forces, ends, MOST_ORDERS))
        return np.log(np.moveaxis(both, 0, 1))

    return solve, mass * own_length


def bridge_of(world: str, seed: int, index: int) -> Bridge:
    """One bridge of a world, by (seed, index) alone."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, index, len(world)]))
    kind = spectral._draw_kind(rng)
    rod, arches = bool(rng.random() < 0.7), 1 + int(rng.random() < 0.5)
    each = HANGERS // arches
    rise = float(np.exp(rng.uniform(np.log(6), np.log(22))))
    at = (np.arange(each) + 1) / (each + 1)
    lengths = np.round(np.maximum(rise * 4 * at * (1 - at), 2.0), 2)
    slender = float(np.exp(rng.uniform(np.log(70), np.log(250))))
    thick = round(min(max(rise / slender, 0.02 if rod else 0.025), 0.14), 3)
    two = rng.random() < 0.4
    modulus, density = (205e9, 7850.0) if rod else (160e9, 83e3 / 9.81)
    stress = float(rng.uniform(60e6, 200e6))
    springs = fe._springs(rng, 0.3, 1000.0)
    slip = 1.0 if rod else float(rng.uniform(0.4, 1.0))
    zones = rng.random() < 0.5
    sensor = float(rng.uniform(0.02, 0.08))
    limit = float(rng.choice([60.0, 100.0, 200.0]))
    share = rng.random()
    planes = PLANES if share >= 0.35 else PLANES[:1]
    scatter = float(np.exp(rng.uniform(np.log(3e-5), np.log(1e-3))))
    found = []
    for number in range(HANGERS):
        length = float(lengths[number % each])
        diameter = round(thick * (0.8 if two and length < np.median(lengths) else 1.0), 3)
        fill = 1.0 if rod else 0.8
        area = np.pi * diameter**2 / 4 * fill
        moment = area**2 / (4 * np.pi)
        nominal = stress * np.pi * thick**2 / 4 * fill * float(rng.uniform(0.95, 1.05))
        ratio = float(np.exp(0.1 * rng.standard_normal()))
        ratio *= float(rng.uniform(0.3, 0.7)) if rng.random() < 0.1 else 1.0
        plan: dict[str, Any] = {
            "rod": rod, "length": length, "area": area, "moment": moment, "modulus": modulus,
            "density": density, "slip": slip, "springs": springs, "tension": ratio * nominal,
            "sensor": sensor, "kind": replace(kind, rod=rod, diameter_m=diameter),
            "zone": ((0.02, 0.02) if zones else (0.0, 0.0), 2.0, 1.4),
        }  # fmt: skip
        make = by_finite_elements if world == "finite_elements" else by_spectral
        solve, whole = make(rng, plan)
        table = solve(TENSIONS)
        coefficients = np.polyfit(np.log(TENSIONS), table.reshape(len(TENSIONS), -1), 3)
        hz = np.exp(table[3])
        orders = int(np.clip((hz < limit).all(axis=0).sum(), 3, MOST_ORDERS))
        text = {"id": number + 1, "length_m": length, "elastic_modulus_pa": modulus}
        if rod:
            text |= {"diameter_m": diameter, "density_kg_m3": density}
        else:
            text |= {"kind": "strand", "area_m2": area, "second_moment_m4": moment}
            text |= {"mass_per_length_kg_m": area * density, "bending_stiffness_factor": 0.7}
        text |= {"nominal_tension_n": nominal}
        if zones and world == "spectral":
            text |= {"fittings_m": [round(0.02 * length, 2)] * 2}
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "hanger.toml"
            lines = (f"{k} = {v!r}\n".replace("'", '"') for k, v in text.items())
            path.write_text("[[hanger]]\n" + "".join(lines), encoding="utf-8")
            hanger = shm.load_hanger(path)
        repeat = float(np.exp(rng.uniform(np.log(1e-5), np.log(5e-4))))
        found.append(
            Truth(
                hanger,
                coefficients.reshape(4, 2, MOST_ORDERS),
                solve([1.0], lamp=True)[0],
                solve([1.0], softer=True)[0],
                orders,
                whole,
                sensor,
                repeat * rng.standard_normal((2, MOST_ORDERS)),
            )
        )
    stated = scatter * float(np.exp(0.2 * rng.standard_normal()))
    per_k = -float(np.exp(rng.uniform(np.log(3e-4), np.log(2e-3))))
    return Bridge(found, planes, scatter, stated, per_k)


def one_more(bridge: Bridge, truth: Truth, rng: Any, change: str = "none") -> ModalTest:
    """One more test: warm or cold, sensors remounted, modes missed; and what has changed."""
    loss = {"-5 %": 0.05, "-10 %": 0.1, "-20 %": 0.2}.get(change, 0.0)
    warmth = float(8 * rng.standard_normal())
    log_tension = np.log1p(-loss) + bridge.per_k * warmth
    log_f = truth.log_f(log_tension) + truth.repeat
    if change == "lamp":
        log_f = log_f + truth.lamp - truth.log_f(0.0)
    if change == "softer end":
        log_f = log_f + truth.softer - truth.log_f(0.0)
    order = np.arange(1, MOST_ORDERS + 1)
    high = min(float(rng.uniform(1.0, 2.5)), 0.45 * truth.hanger.length_m)
    moves = np.sin(np.pi * order * high / truth.hanger.length_m) ** 2 - 0.5
    log_f = log_f - truth.sensor_kg / truth.whole_kg * moves
    log_f = log_f + bridge.scatter * rng.standard_normal(log_f.shape)
    missed = 0.3 if change == "few modes" else 0.04
    keep = rng.random(log_f.shape) >= missed
    mistaken = int(rng.integers(1, truth.orders)) if change == "mistaken order" else -1
    modes = []
    for plane in bridge.planes:
        at = PLANES.index(plane)
        for n in range(truth.orders):
            hz = float(np.exp(log_f[at, n]))
            if n == mistaken and plane == bridge.planes[0]:  # a peak between it and its neighbour
                hz += float(rng.uniform(0.1, 0.5)) * float(np.exp(log_f[at, n - 1]) - hz)
            if keep[at, n] or n < 2:
                modes.append(Mode(plane, n + 1, hz, hz * bridge.stated))
    return ModalTest("t", tuple(modes), hanger=truth.hanger.id, temperature_c=12 + warmth)


def alike(bridge: Bridge, one: Truth, other: Truth) -> bool:
    """Whether exact frequencies agree once the tension may differ by a quarter."""
    rows = [PLANES.index(plane) for plane in bridge.planes]
    orders = min(one.orders, other.orders)
    sd = np.hypot(bridge.scatter, 3e-4)
    target = other.log_f(0.0)[rows, :orders]
    tries = [one.log_f(t)[rows, :orders] - target for t in np.linspace(np.log(0.75), 0.22, 300)]
    return bool(min(np.sqrt(((each / sd) ** 2).mean()) for each in tries) < 3)


def twins(one: Truth, other: Truth) -> bool:
    a, b = one.hanger, other.hanger
    return a.length_m == b.length_m and a.area_m2 == b.area_m2


def scaled(test: ModalTest, factor: float) -> ModalTest:
    modes = tuple(
        replace(m, frequency_hz=factor * m.frequency_hz, frequency_sd_hz=factor * m.frequency_sd_hz)
        for m in test.modes
    )
    return replace(test, modes=modes)


def trial(task: tuple[str, int, int]) -> list[dict[str, Any]]:
    """All tests of one bridge: rows of what was filed and what was said."""
    world, seed, index = task
    bridge = bridge_of(world, seed, index)
    rng = np.random.default_rng(np.random.SeedSequence([seed, index, 7]))
    rows = []
    for own_tests, other_tests in HISTORIES:
        past = {
            truth.hanger.id: tuple(one_more(bridge, truth, rng) for _ in range(5))
            for truth in bridge.hangers
        }
        for number in rng.choice(HANGERS, ASKED, replace=False).tolist():
            truth = bridge.hangers[number]
            own = Known(truth.hanger, past[truth.hanger.id][:own_tests])
            others = [
                Known(t.hanger, past[t.hanger.id][:other_tests])
                for t in bridge.hangers
                if t is not truth
            ]
            other = bridge.hangers[(number + 1 + int(rng.integers(HANGERS - 1))) % HANGERS]
            change = CHANGES[(number + index) % len(CHANGES)]
            factor = FACTORS[(number + index) % len(FACTORS)]
            cases = [
                ("right", change, one_more(bridge, truth, rng, change)),
                ("right", "none", one_more(bridge, truth, rng)),
                ("swapped", "", one_more(bridge, other, rng)),
                ("rate", f"{factor:.4g}", scaled(one_more(bridge, truth, rng), factor)),
            ]
            for kind, which, test in cases:
                started = time.process_time()
                said = doubt_of(test, own, others)
                seconds = time.process_time() - started
                row = {"world": world, "bridge": index, "history": (own_tests, other_tests)}
                row |= {"kind": kind, "which": which, "seconds": seconds}
                row |= {"doubt": "" if said is None else said.kind, "modes": len(test.modes)}
                row |= {"strand": truth.hanger.kind == "strand", "hanger": truth.hanger.id}
                row |= {"candidate": None if said is None else said.hanger}
                row |= {"other": other.hanger.id, "planes": len(bridge.planes)}
                row |= {"twins": twins(truth, other), "alike": alike(bridge, truth, other)}
                row |= {"length_ratio": other.hanger.length_m / truth.hanger.length_m}
                rows.append(row)
    return rows


def interval(hits: int, of: int) -> str:
    """A share with its 95 % interval by Clopper and Pearson."""
    if not of:
        return "-"
    low = beta.ppf(0.025, hits, of - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, of - hits) if hits < of else 1.0
    return f"{hits}/{of} = {100 * hits / of:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bridges", type=int, default=4, help="of each world")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--misses", action="store_true", help="print each wrong answer")
    parser.add_argument("--out", type=Path, help="write all rows here, bridge by bridge")
    args = parser.parse_args()
    tasks = [
        (w, args.seed, i) for i in range(args.bridges) for w in ("finite_elements", "spectral")
    ]
    rows: list[dict[str, Any]] = []
    with ProcessPoolExecutor(2) as pool:
        for part in pool.map(trial, tasks):
            rows += part
            if args.out:
                args.out.write_text(json.dumps(rows), encoding="utf-8")
    report(rows, args.misses)


def report(rows: list[dict[str, Any]], misses: bool) -> None:
    """Shares of doubted tests by history and kind, each with its interval."""
    groups: dict[tuple[Any, ...], list[bool]] = defaultdict(list)
    for row in rows:
        doubted, key = bool(row["doubt"]), row["kind"]
        if key == "swapped":
            known = row["history"][0] > 0
            key += " twins" if row["twins"] else " alike" if row["alike"] and known else ""
            if not known and not row["twins"]:
                key += " strands" if row["strand"] else " rods"
                ratio = abs(np.log(row["length_ratio"]))
                key += " < 3 % in length" if ratio < 0.03 else ""
        groups[tuple(row["history"]), key].append(doubted)
        if row["kind"] != "swapped":
            groups[tuple(row["history"]), f"  {row['kind']} {row['which']}"].append(doubted)
        if misses and doubted != (row["kind"] != "right") and not row["twins"]:
            print({k: v for k, v in row.items() if k != "seconds"})
    for (history, key), each in sorted(groups.items()):
        print(f"{history}  {key:34s} doubted {interval(sum(each), len(each))}")
    named = [r["candidate"] == r["other"] for r in rows if r["kind"] == "swapped" and r["doubt"]]
    print("of doubted swaps the right other hanger is named:", interval(sum(named), len(named)))
    seconds = [row["seconds"] for row in rows]
    print(f"{np.median(seconds):.3f} s a test (95 %: {np.quantile(seconds, 0.95):.3f} s)")


if __name__ == "__main__":
    main()
