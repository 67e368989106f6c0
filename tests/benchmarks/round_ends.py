"""Round ends that turn softly, alike in both planes: which tension is stated, and what is said?

    python tests/benchmarks/round_ends.py

Exact frequencies of beam3, six orders in two planes, a standard deviation of 1e-4, no sensor: the
case in which frequencies tell a soft spring from tension worst (docs/trials/validation.md).
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import product

import numpy as np

from shm.inference import UpdateOptions, select
from shm.models import THESIS, build
from shm.values import PLANES, Hanger, ModalTest, Mode

BARS_M = ((0.020, 3.0), (0.060, 9.0))
XI = (3.0, 8.0, 20.0)
RESTRAINTS = (1.0, 2.0, 3.0, 5.0)
ORDERS, SD, SEED = 6, 1e-4, 91
CLASSES = ("beam1", "beam2", "beam3")


@dataclass(frozen=True)
class Case:
    """Diameter and length in m, sqrt(T L^2 / EI), and k L / EI of all four springs."""

    diameter_m: float
    length_m: float
    xi: float
    restraint: float
    nominal: float
    """Of the true tension."""


def cases() -> list[Case]:
    rng = np.random.default_rng(SEED)
    every = product(BARS_M, XI, RESTRAINTS)
    return [Case(*bar, xi, k, float(rng.uniform(0.6, 1.6))) for bar, xi, k in every]


def told(case: Case) -> tuple[float, float, float, tuple[str, ...]]:
    """The stated mean, its 90 % interval, all over the true tension, and the caveats."""
    area = np.pi * case.diameter_m**2 / 4
    moment = np.pi * case.diameter_m**4 / 64
    stiffness = 200e9 * moment
    tension_n = case.xi**2 * stiffness / case.length_m**2
    hanger = Hanger(
        1,
        case.length_m,
        200e9,
        area,
        moment,
        7850 * area,
        case.nominal * tension_n,
        diameter_m=case.diameter_m,
    )
    model = build("beam3", hanger, THESIS)
    spring = np.log10(case.restraint * stiffness / case.length_m)
    truth = {"theta_F": 1 / case.nominal, "theta_L": 1.0}
    theta = np.array([[truth.get(name, spring) for name in model.parameter_names]])
    frequencies = model.frequencies_hz(theta, ORDERS)[0]
    modes = tuple(
        Mode(plane, k + 1, float(f), frequency_sd_hz=SD * float(f))
        for plane, row in zip(PLANES, frequencies, strict=True)
        for k, f in enumerate(row)
    )
    test = ModalTest("exact", modes, hanger=1)
    found = select([test], [build(name, hanger) for name in CLASSES], UpdateOptions())
    averaged = found.averaged
    stated = averaged.tension_n
    return (
        stated.mean / tension_n,
        stated.q05 / tension_n,
        stated.q95 / tension_n,
        averaged.caveats,
    )


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    covered, warned, every = 0, 0, cases()
    with ProcessPoolExecutor(2) as pool:
        for case, (mean, low, high, caveats) in zip(every, pool.map(told, every), strict=True):
            holds = low <= 1 <= high
            says = any("The ends decide" in caveat for caveat in caveats)
            covered, warned = covered + holds, warned + (says and not holds)
            what = (
                f"{case.diameter_m * 1e3:3.0f} mm, xi {case.xi:3.0f}, k L/EI {case.restraint:2.0f}"
            )
            stated = f"{mean:.3f} ({low:.3f} to {high:.3f}) of the truth"
            print(
                f"{what}: {stated}{'' if holds else '  MISSED'}{'  said' if says else ''}",
                flush=True,
            )
    missed = len(every) - covered
    print(f"{covered} of {len(every)} covered; of {missed} missed {warned} say so")


if __name__ == "__main__":
    main()
