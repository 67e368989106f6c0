"""What a plane of the general hanger model costs in batches, beside the exact beam.

Hangers like hanger 3 with parameters drawn as a diagnosis draws them; ten modes a plane, four
biaxial sensors. Processor time, the least of repeats, as other work on the machine only adds.
`bar` is as described, `springs` stands on end springs, and so on for each kind of term. Exits 1
where a plane with its shapes costs more than 300 microseconds. Run on one thread:

    OMP_NUM_THREADS=1 python tests/benchmarks/general_model.py
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from shm.models import tensioned_beam
from shm.models.hanger import LateralSpring, PhysicalHanger, PointMass, Zone, solve
from tests.helpers.hangers import HANGER_3
from tests.helpers.physical_hangers import EI, LENGTH, MASS, TENSION, on_springs

MODES, PLACES = 10, np.array([1.2, 3.6, 6.0, 9.0])
MOST_MICROSECONDS = 300.0


def hangers(rows: int, rng: np.random.Generator) -> dict[str, PhysicalHanger]:
    """A batch of each kind; all but `bar` on springs that differ by end and plane."""
    one = np.ones(rows)
    bar = PhysicalHanger.clamped(HANGER_3, TENSION * rng.uniform(0.5, 5, rows), len(PLACES))
    sprung = on_springs(bar, *10 ** rng.uniform(5, 12, (2, rows, 2)))
    middle, half = rng.uniform(0, LENGTH, rows), rng.uniform(0.1, 3, rows)
    zone = Zone(middle - half, middle + half, np.full((rows, 2), 0.5), 0.7 * one)
    masses = tuple(PointMass(rng.uniform(0, LENGTH, rows), 20 * one) for _ in range(5))
    spring = LateralSpring(middle, rng.uniform(0, 1e6, (rows, 2)), 0.1 * one)
    axis = np.stack([np.cos(middle), np.sin(middle)], axis=-1)
    skewed = np.repeat((axis[:, :, None] * axis[:, None] / 1e6)[:, None], 2, axis=1)
    moving = np.full((rows, 2, 2), 1e-7)
    return {
        "bar": bar,
        "springs": sprung,
        "zone": replace(sprung, zones=(zone,)),
        "two zones": replace(sprung, zones=(zone, replace(zone, start_m=0 * one))),
        "mass": replace(sprung, masses=masses[:1]),
        "five masses": replace(sprung, masses=masses),
        "lateral spring": replace(sprung, springs=(spring,)),
        "sag": replace(sprung, sag_parameter=rng.uniform(0, 20, (rows, 2))),
        "shear": replace(sprung, shear_compliance_1_n=1e-9 * one, rotary_inertia_kg_m=0.1 * one),
        "supports": replace(
            sprung, translational_compliance_m_n=moving, support_mass_kg=moving * 1e10
        ),
        "turned axes": replace(bar, rotational_compliance_rad_n_m=skewed),
    }


def microseconds(call: Callable[[], object], planes: int, repeats: int) -> float:
    """Processor time of one of the `planes` that a call solves, the least of repeats."""
    taken = []
    for _ in range(repeats):
        started = time.process_time()
        call()
        taken.append((time.process_time() - started) / planes * 1e6)
    return min(taken)


def exact_microseconds(rows: int, repeats: int, rng: np.random.Generator) -> float:
    tension = TENSION * rng.uniform(0.5, 5, (rows, 1))
    springs = 10 ** rng.uniform(5, 12, (2, rows, 2))
    bar = np.array(LENGTH), tension, np.array(EI), np.array(MASS)
    return microseconds(
        lambda: tensioned_beam.frequencies_hz(*bar, *springs, MODES), 2 * rows, repeats
    )


def main() -> int:
    """Prints the table; 1 where the bound fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=32)
    parser.add_argument("--repeats", type=int, default=40)
    arguments = parser.parse_args()
    rows, repeats, rng = arguments.rows, arguments.repeats, np.random.default_rng(1)
    exact = exact_microseconds(rows, repeats, rng)
    print(f"{MODES} modes, batches of {rows}; the exact beam: {exact:.1f} microseconds a plane")
    print(f"{'microseconds a plane':22s} frequencies  with shapes  frequencies / exact")
    worst = 0.0
    for name, batch in hangers(rows, rng).items():
        bare, full = (
            microseconds(lambda: solve(batch, MODES, PLACES, shapes), 2 * rows, repeats)  # noqa: B023
            for shapes in (False, True)
        )
        worst = max(worst, full)
        print(f"{name:22s} {bare:11.0f} {full:12.0f} {bare / exact:20.0f}")
    kept = worst <= MOST_MICROSECONDS
    print(f"bound ({MOST_MICROSECONDS:g} microseconds): {'kept' if kept else 'FAILED'}")
    return 0 if kept else 1


if __name__ == "__main__":
    raise SystemExit(main())
