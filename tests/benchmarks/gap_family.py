"""One cause shared by hangers of a bridge: the joint diagnosis beside one hanger at a time.

python tests/benchmarks/gap_family.py                       # 4 families of 8 hangers, and 4 sound
python tests/benchmarks/gap_family.py --families 8 --sound 8 --hangers 20 --seed 5
python tests/benchmarks/gap_family.py --keep /tmp/families  # keeps what single hangers say

Truth comes from the finite elements of `tests/worlds`, which share nothing with the product, with
their nuisances of the field: sections, moduli, densities and lengths as made, own weight, the
sensors' mass, errors that repeat in all tests. All hangers of a bridge are rods of one diameter,
clamped, without shear; each has a tension of its own, 0.7 to 1.3 times nominal. Half of the
families share the cause in all hangers, as they do a clock, half in 40 to 80 %; a fifth of the
others have a cause of their own. Sizes scatter by 15 % about the family's. Six to eight seconds a
hanger.
"""

from __future__ import annotations

import argparse
import math
import pickle
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shm.gap import GapOptions
from shm.gap.bridge.bridge_diagnosis import diagnose_jointly, examine_hanger
from shm.gap.bridge.shared_evidence import HangerEvidence
from shm.values import PLANES, BridgeDiagnosis, Diagnosis, Hanger, ModalTest, Mode
from tests.benchmarks.shares import share
from tests.worlds import finite_elements as world
from tests.worlds.bars import (
    GRAVITY_M_S2,
    POISSON,
    Bar,
    Zone,
    cowper,
    natural_frequencies_hz,
)

SCATTER = 0.15
OWN_CAUSES = 0.2
ALL_OF_THEM = 0.5
SENSOR_KG = 0.08  # the heaviest of the world's: a shared mass no larger is the sensors', and true
CLOCK = "timebase"  # of the logger that measured the whole bridge
CLAMP = 1e6  # k L/EI: at 1000 a taut bar's boundary layer is 1.4 % softer, a stiffness 3 % lower
DENSITY_KG_M3, MODULUS_PA = 7850.0, 205e9
# Sizes: log-uniform, k L/EI, kg, lost part of EI, fractions, m over L, fraction of the clock.
SIZES = {
    "rotational_end_flexibility": (2.0, 15.0),
    "point_mass": (3.0, 12.0),
    "section_loss": (0.3, 0.6),
    "distributed_mass": (0.03, 0.12),
    "effective_length": (0.008, 0.03),
    "timebase": (0.01, 0.03),
    "shear_and_rotary_inertia": (1.0, 1.0),
    "intermediate_support": (1.0, 10.0),
}


@dataclass(frozen=True, eq=False)
class Member:
    """A hanger as described and measured, with its true tension and cause."""

    hanger: Hanger
    tests: tuple[ModalTest, ...]
    tension_n: float
    cause: str


def bridge(seed: int, index: int, count: int, cause: str) -> list[Member]:
    """A bridge of `count` hangers that share `cause`; of sound ones where it is empty."""
    rng = np.random.default_rng([seed, index, len(cause)])
    diameter_m = rng.uniform(0.05, 0.10)
    longest_m = diameter_m * rng.uniform(110, 170)
    along = np.linspace(-0.8, 0.8, count)
    lengths_m = longest_m * (1 - 0.7 * along**2) * (1 + 0.02 * rng.standard_normal(count))
    nominal_n = 1e6 * rng.uniform(80, 200) * np.pi * diameter_m**2 / 4
    size = np.exp(rng.uniform(*np.log(SIZES[cause]))) if cause else 0.0
    some = rng.permutation(count) < max(2, round(count * rng.uniform(0.4, 0.8)))
    shared = np.ones(count, bool) if rng.random() < ALL_OF_THEM or cause == CLOCK else some
    height_m = rng.uniform(0.25, 0.4) * lengths_m.min()
    settings = np.exp(rng.uniform(np.log(2e-5), np.log(3e-4))), rng.integers(5, 9, 2)
    members = []
    for number in range(count):
        own = np.random.default_rng([seed, index, number, len(cause)])
        each = cause if cause and shared[number] else ""
        own_size = size * np.exp(SCATTER * own.standard_normal())
        place_m = height_m
        if cause and not each and own.random() < OWN_CAUSES:
            each = "point_mass" if cause != "point_mass" else "section_loss"
            own_size = np.exp(own.uniform(*np.log(SIZES[each])))
            place_m = own.uniform(0.2, 0.8) * lengths_m[number]
        members.append(
            member(own, number + 1, diameter_m, float(lengths_m[number]), float(lengths_m.mean()),
                   float(nominal_n), each, float(own_size), float(place_m), *settings)
        )  # fmt: skip
    return members


def member(
    rng: np.random.Generator, number: int, diameter_m: float, length_m: float, mean_m: float,
    nominal_n: float, cause: str, size: float, place_m: float, sd: float, modes: Any,
) -> Member:  # fmt: skip
    """One hanger with its cause, by finite elements, measured twice."""
    nuisances = world.Nuisances()
    area = np.pi * diameter_m**2 / 4
    described = Hanger(
        id=number, length_m=length_m, elastic_modulus_pa=MODULUS_PA, area_m2=area,
        second_moment_m4=area**2 / (4 * np.pi), mass_per_length_kg_m=DENSITY_KG_M3 * area,
        nominal_tension_n=nominal_n, diameter_m=diameter_m,
    )  # fmt: skip
    off = rng.standard_normal(4)
    made = area * (1 + nuisances.area_sd * off[0])
    bending = MODULUS_PA * (1 + nuisances.modulus_sd * off[1]) * made**2 / (4 * np.pi)
    mass = DENSITY_KG_M3 * (1 + nuisances.density_sd * off[2]) * made
    tension_n = nominal_n * rng.uniform(0.7, 1.3)
    sensor = min(rng.uniform(1.0, 2.5), 0.45 * length_m), rng.uniform(*nuisances.sensor_mass_kg)
    clamp = CLAMP * bending / length_m
    bar = Bar(
        length_m=length_m * (1 + nuisances.length_sd * off[3]), tension_n=tension_n,
        bending_stiffness_n_m2=bending, mass_per_length_kg_m=mass, rotation_n_m_rad=(clamp, clamp),
        gravity_along_m_s2=GRAVITY_M_S2, masses=(sensor,),
    )  # fmt: skip
    bar = with_cause(bar, cause, size, place_m, mean_m, made)
    clock = 1 + size if cause == "timebase" else 1.0
    exact_hz = clock * natural_frequencies_hz(bar, int(max(modes)))
    repeat = np.exp(rng.uniform(*np.log(nuisances.repeat_sd)))
    bias = repeat * rng.standard_normal((2, len(exact_hz)))
    tests = []
    for test in ("t1", "t2"):
        error = sd * rng.standard_normal((2, len(exact_hz)))
        found = [
            Mode(plane, order, float(hz), float(sd * hz), np.nan, np.nan, ())
            for index, plane in enumerate(PLANES)
            for order in range(1, int(modes[index]) + 1)
            for hz in [exact_hz[order - 1] * (1 + (bias + error)[index, order - 1])]
        ]
        tests.append(ModalTest(test, tuple(found), number))
    return Member(described, tuple(tests), float(tension_n), cause)


def with_cause(
    bar: Bar, cause: str, size: float, place_m: float, mean_m: float, area: float
) -> Bar:
    """The bar with its cause; a spring and a length are the same whatever the hanger's length."""
    bending, length_m = bar.bending_stiffness_n_m2, bar.length_m
    if cause == "rotational_end_flexibility":
        return replace(bar, rotation_n_m_rad=(size * bending / mean_m, bar.rotation_n_m_rad[1]))
    if cause == "point_mass":
        return replace(bar, masses=(*bar.masses, (place_m, size)))
    if cause == "section_loss":
        half_m = 0.03 * mean_m
        left = 1 - min(size, 0.7)  # a round thinned all around: I ~ A^2
        worn = Zone(place_m - half_m, place_m + half_m, left, math.sqrt(left))
        return replace(bar, zones=(worn,))
    if cause == "distributed_mass":
        return replace(bar, mass_per_length_kg_m=bar.mass_per_length_kg_m * (1 + size))
    if cause == "effective_length":
        return replace(bar, length_m=length_m + size * mean_m)
    if cause == "intermediate_support":
        across = length_m / (place_m * (length_m - place_m))
        own = bar.tension_n * across + 3 * bending / length_m * across**2
        return replace(bar, springs=((place_m, size * own),))
    if cause == "shear_and_rotary_inertia":
        shear = cowper() * MODULUS_PA / (2 * (1 + POISSON)) * area
        inertia = DENSITY_KG_M3 * area**2 / (4 * np.pi)
        return replace(bar, shear_stiffness_n=shear, rotary_inertia_kg_m=inertia)
    return bar


def examined(members: list[Member], options: GapOptions) -> list[HangerEvidence]:
    """Each hanger of a bridge by itself."""
    return [examine_hanger(each.tests, each.hanger, options) for each in members]


def names(found: Diagnosis | BridgeDiagnosis) -> set[str]:
    """The effects that an answer claims, with those alike."""
    leading = found.leading
    if leading is None:
        return set()
    group = (leading.effect,) if leading.group is None else found.groups[leading.group]
    return {name for each in group for name in each.split(" + ")}


def scored(
    members: list[Member], patients: list[HangerEvidence], found: BridgeDiagnosis
) -> dict[str, Any]:
    """What became of one bridge."""
    cause = shared_cause(members)
    truth = {m.hanger.id for m in members if m.cause == cause} if cause else set()
    leading = found.leading
    told = set(leading.named) if leading else set()
    errors = [
        (t.alone_n.mean / m.tension_n - 1, t.jointly_n.mean / m.tension_n - 1,
         t.jointly_n.q025 <= m.tension_n <= t.jointly_n.q975,
         t.alone_n.q025 <= m.tension_n <= t.alone_n.q975, m.hanger.id in truth)
        for m, t in zip(members, found.tensions, strict=True)
    ]  # fmt: skip
    singles = [p.diagnosis for m, p in zip(members, patients, strict=True) if m.hanger.id in truth]
    sensor = leading is not None and leading.effect == "point_mass" and leading.size.q05 < SENSOR_KG
    return {
        "cause": cause,
        "answer": leading.effect if leading else found.leads,
        "sensor": sensor,
        "apart": found.each_for_itself_probability,
        "claim": found.claim(leading) if leading else 0.0,
        "first": bool(leading and leading.effect == cause),
        "in group": cause in names(found),
        "single first": [bool(d.leading and d.leading.effect == cause) for d in singles],
        "single in group": [cause in names(d) for d in singles],
        "hit": len(told & truth),
        "told": len(told),
        "true": len(truth),
        "errors": errors,
    }


def shared_cause(members: list[Member]) -> str:
    """The cause that most have; an own one is a point mass or a loss in few."""
    causes = [m.cause for m in members if m.cause]
    return max(causes, key=causes.count, default="")


def table(rows: list[dict[str, Any]]) -> str:
    """All numbers with 90 % intervals (Clopper and Pearson), as Markdown."""
    families, sound = [r for r in rows if r["cause"]], [r for r in rows if not r["cause"]]
    singles = {k: [x for r in families for x in r[k]] for k in ("single first", "single in group")}
    lines = ["| what | together | one hanger at a time |", "|---|---|---|"]
    if families:
        count, alone = len(families), len(singles["single first"])
        for key, title in (("first", "named first"), ("in group", "named or in its group")):
            together = share(sum(r[key] for r in families), count)
            lines.append(
                f"| {title} | {together} | {share(sum(singles[f'single {key}']), alone)} |"
            )
        hit, told, true = (sum(r[key] for r in families) for key in ("hit", "told", "true"))
        lines.append(
            f"| members, F1 | {2 * hit / max(told + true, 1):.3f} "
            f"({hit} of {told} named, of {true} true) | |"
        )
        errors = np.array([e for r in families for e in r["errors"]], dtype=float)
        for chosen, title in ((errors[:, 4] > 0, "members"), (errors[:, 4] >= 0, "all hangers")):
            rms = 100 * np.sqrt(np.mean(errors[chosen, :2] ** 2, axis=0))
            mean = 100 * np.abs(errors[chosen, :2]).mean(axis=0)
            covered = errors[chosen, 2:4].mean(axis=0)
            lines.append(f"| tension, {title}: rms error, % | {rms[1]:.2f} | {rms[0]:.2f} |")
            lines.append(f"| mean error, % | {mean[1]:.2f} | {mean[0]:.2f} |")
            lines.append(f"| 95 % interval covers | {covered[0]:.2f} | {covered[1]:.2f} |")
    if sound:
        claimed = [r for r in sound if r["answer"] != "each for itself"]
        false = sum(not r["sensor"] for r in claimed)
        lines.append(f"| sharing claimed on sound bridges | {share(false, len(sound))} | |")
        lines.append(f"| the sensors' own mass found there | {len(claimed) - false} | |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--families", type=int, default=4)
    parser.add_argument("--sound", type=int, default=4)
    parser.add_argument("--hangers", type=int, default=8)
    parser.add_argument("--cause", action="append", choices=list(SIZES), help="of the families")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--baseline", default="beam1")
    parser.add_argument("--keep", type=Path, help="a folder for what single hangers say")
    given = parser.parse_args()
    options, causes = GapOptions(baseline=given.baseline), given.cause or list(SIZES)
    wanted = [causes[i % len(causes)] for i in range(given.families)] + [""] * given.sound
    rows = []
    for index, cause in enumerate(wanted):
        members = bridge(given.seed, index, given.hangers, cause)
        kept = given.keep and given.keep / f"{given.seed}_{given.hangers}_{index}_{cause}.pickle"
        if kept and kept.exists():
            patients = pickle.loads(kept.read_bytes())
        else:
            patients = examined(members, options)
            if kept:
                kept.write_bytes(pickle.dumps(patients))
        row = scored(members, patients, diagnose_jointly(patients, options))
        rows.append(row)
        print(
            f"{cause or 'sound'}: {row['answer']}, apart {row['apart']:.3f}, claim "
            f"{row['claim']:.2f}, members {row['hit']} of {row['true']}, {row['told']} named; "
            f"single first {sum(row['single first'])}",
            flush=True,
        )
    print(table(rows))


if __name__ == "__main__":
    main()
