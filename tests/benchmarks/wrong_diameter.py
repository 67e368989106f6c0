"""A diameter described 5 % wrong, and sound descriptions: what is stated, and what is said?

    python tests/benchmarks/wrong_diameter.py --hangers 24

Random rods at 60 to 120 N/mm2 on springs, five to eight orders of two planes with errors of 2e-4,
by beam2. A sound description scatters as `Scatter` says; a wrong one is off by ten of its standard
deviations (docs/trials/validation.md).
"""

from __future__ import annotations

import begin
import numpy as np

import shm
from shm.inference import UpdateOptions, select
from shm.models import build
from shm.models.classes.tensioned_beam import frequencies_hz
from shm.values import PLANES, Hanger, ModalTest, Mode

MODULUS_PA, DENSITY_KG_M3, ERROR = 205e9, 7850.0, 2e-4
DESCRIBED = {"5 % too large": 1.05, "5 % too small": 0.95, "sound": 1.0}


def described(diameter_m: float, length_m: float, nominal_n: float) -> Hanger:
    return shm.round_bar(
        1, diameter_m=diameter_m, length_m=length_m, nominal_tension_n=nominal_n,
        elastic_modulus_pa=MODULUS_PA, density_kg_m3=DENSITY_KG_M3,
    )  # fmt: skip


def case(seed: int, factor: float) -> tuple[float, float, float, bool]:
    """Mean and 90 % interval over the true tension, and whether it says that the description is
    wrong; with a `factor` of 1 the bar is off its description as sound ones are."""
    rng = np.random.default_rng(seed)
    diameter_m = rng.uniform(0.05, 0.10)
    length_m = diameter_m * rng.uniform(80, 170)
    tension_n = rng.uniform(60e6, 120e6) * np.pi * diameter_m**2 / 4
    springs, orders = 10 ** rng.uniform(0.5, 2.5, (2, 2)), int(rng.integers(5, 9))
    hanger = described(factor * diameter_m, length_m, 1.05 * tension_n)
    bar, scatter = described(diameter_m, length_m, tension_n), hanger.scatter
    sds = (scatter.section, scatter.density, scatter.length, scatter.modulus)
    section, density, length, modulus = np.exp(rng.standard_normal(4) * sds * (factor == 1.0))
    stiffness = np.asarray(bar.bending_stiffness_n_m2 * section**2 * modulus)
    mass = np.asarray(bar.mass_per_length_kg_m * section * density)
    modes = []
    for plane, ends in zip(PLANES, springs, strict=True):
        at = (np.full(1, k * stiffness / length_m) for k in ends)
        long, pulled = np.full(1, length_m * length), np.full(1, tension_n)
        exact = frequencies_hz(long, pulled, stiffness, mass, *at, orders)[0]
        for order, hz in enumerate(exact * (1 + ERROR * rng.standard_normal(orders)), start=1):
            modes.append(Mode(plane, order, float(hz), frequency_sd_hz=ERROR * float(hz)))
    test = ModalTest("t", tuple(modes), hanger=1)
    found = select([test], [build("beam2", hanger)], UpdateOptions(samples=600)).averaged
    stated = found.tension_n
    says = any(each.startswith("The description does not fit") for each in found.caveats)
    return stated.mean / tension_n, stated.q05 / tension_n, stated.q95 / tension_n, says


def main() -> None:
    asked = begin.options(__doc__, hangers=24, seed=5000)
    for name, factor in DESCRIBED.items():
        said = held = 0
        for seed in range(asked.seed, asked.seed + asked.hangers):
            mean, low, high, says = case(seed, factor)
            said, held = said + says, held + (low <= 1 <= high)
            print(
                f"{name}, {seed}: {mean:.3f} ({low:.3f} to {high:.3f}) of the truth"
                f"{'  said' if says else ''}",
                flush=True,
            )
        print(f"{name}: {said} of {asked.hangers} say so; {held} intervals hold the truth")


if __name__ == "__main__":
    main()
