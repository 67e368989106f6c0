"""Updating in adopted classes: cost, convergence, and whether the planted tension is found.

Run it with `python tests/benchmarks/adopted_classes.py [SAMPLES]`. For each effect one test of 8
modes a plane, identified to 0.1 %, is made by the class itself and updated from scratch; then a
second test from the posterior of the first. Exits 1 where a tension lies beyond 4 standard
deviations of its posterior, where batches of draws disagree (R-hat above 1.2), or where an update
takes more than 60 s of processor time.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from shm.inference import UpdateOptions, refresh, update
from shm.models import Model, build
from shm.values import PLANES, ModalTest, Mode, Posterior
from tests.helpers.hangers import HANGER_3

SD, MODES = 1e-3, 8
CASES = {
    "bending_stiffness@everywhere": {"stiffness_change": 0.1},
    "distributed_mass@everywhere": {"log10_mass_change": -1.5},
    "effective_length@both_ends": {"length_change_m": 0.3},
    "rotational_end_flexibility@both_ends": {"log10_k1": 6.8, "log10_k2": 7.0},
    "rotational_end_flexibility@deck_end.transverse": {"log10_k1": 6.5},
    "stiff_end_zones@both_ends": {"log10_zone_m": -0.3, "log10_stiffness_ratio": 1.0},
    "point_mass@everywhere:x_m=3.2..3.6": {"log10_mass_kg": 1.08, "x_m": 3.4},
    "point_mass@everywhere": {"log10_mass_kg": 1.08, "x_m": 3.4},
    "intermediate_support@everywhere": {"log10_stiffness_n_m": 5.0, "x_m": 4.0},
    "temperature_tension@everywhere:reference_c=10:tension_per_kelvin_n_k=-1100..-900": {
        "tension_per_kelvin_n_k": -1000.0
    },
}


def planted(model: Model, values: dict[str, float], seed: int) -> ModalTest:
    """One test at 25 C of the hanger at its nominal tension."""
    known = {"theta_F": 1.0, **values}
    theta = np.array([[known.get(name, 0.0) for name in model.parameter_names]])
    test = ModalTest("t", (), 3, temperature_c=25.0)
    exact = model.frequencies_at(theta, MODES, model.conditions(test))[0]
    noisy = exact * (1 + SD * np.random.default_rng(seed).standard_normal(exact.shape))
    modes = tuple(
        Mode(plane, order + 1, float(noisy[row, order]), float(SD * exact[row, order]))
        for row, plane in enumerate(PLANES)
        for order in range(MODES)
    )
    return ModalTest("t", modes, 3, temperature_c=25.0)


def line(name: str, found: Posterior, seconds: float) -> bool:
    """Prints what an update gave and took; whether it keeps the bounds."""
    tension_kn = found.tension_n / 1e3
    off = (tension_kn.mean() - HANGER_3.nominal_tension_n / 1e3) / tension_kn.std()
    print(
        f"{name[:60]:60} {found.method:12} {tension_kn.mean():7.1f} ± {tension_kn.std():5.1f} kN "
        f"{found.effective_sample_size:5.0f} of {len(found.samples)} {found.r_hat:6.3f} "
        f"{found.evaluations:7d} {seconds:6.1f} s",
        flush=True,
    )
    return abs(off) < 4 and found.r_hat < 1.2 and seconds < 60


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("samples", nargs="?", type=int, default=300)
    options = UpdateOptions(samples=parser.parse_args().samples)
    kept = []
    for effect, values in CASES.items():
        model = build(f"beam1+{effect}", HANGER_3)
        first, second = (planted(model, values, seed) for seed in (1, 2))
        began = time.process_time()
        known = update([first], model, options)
        between = time.process_time()
        later = refresh([second], model, known, options)
        kept.append(line(effect, known, between - began))
        kept.append(line(effect, later, time.process_time() - between))
    print(f"{sum(kept)} of {len(kept)} keep the bounds")
    return 0 if all(kept) else 1


if __name__ == "__main__":
    sys.exit(main())
