"""Calibrate a hanger by one reading of a load cell; later tests profit from it.

Frequencies alone leave the mass and the length of the bar open, which is 1 to 2 % of the tension.
A reading of 0.3 % closes most of that for this test and for every later one of the hanger.
"""

import numpy as np
from matplotlib.figure import Figure

import shm
from shm.models import build

hanger = shm.round_bar(
    3,
    diameter_m=0.130,
    length_m=12.0,
    elastic_modulus_pa=200e9,
    density_kg_m3=7800,
    nominal_tension_n=711e3,
)
truth_n = 690e3
(planes_hz,) = build("beam1", hanger, priors="thesis").frequencies_hz(
    np.array([[truth_n / 711e3, 1.0]]), modes=6
)
modes = tuple(
    shm.Mode(plane, order, frequency_hz, frequency_sd_hz=1e-4 * frequency_hz)
    for plane, row in zip(("transverse", "longitudinal"), planes_hz, strict=True)
    for order, frequency_hz in enumerate(row.tolist(), 1)
)

# Shown in the manual from here.
lift_off = shm.ModalTest("lift-off", modes, hanger=3, tension_read_n=truth_n, tension_read_sd_n=2e3)
later = shm.ModalTest("later", modes, hanger=3)
without = shm.update(later, hanger, model="beam1", seed=1)
calibrated = shm.update(later, hanger, model="beam1", seed=1, calibrated_by=[lift_off])
# Shown in the manual until here.

widths = [np.ptp(np.quantile(each.tension_n, [0.05, 0.95])) for each in (without, calibrated)]
print(f"90 % interval {widths[0] / 1e3:.0f} kN wide without, {widths[1] / 1e3:.0f} kN with")

figure = Figure(layout="constrained")
axes = figure.subplots()
for each, label in ((without, "without a reading"), (calibrated, "calibrated")):
    axes.hist(each.tension_n / 1e3, bins=40, density=True, histtype="step", label=label)
axes.axvline(truth_n / 1e3, color="black", linestyle=":")
axes.set(xlabel="tension (kN)", ylabel="density")
axes.legend()

assert widths[1] < 0.75 * widths[0]
assert abs(calibrated.tension_n.mean() - truth_n) < 3 * calibrated.tension_n.std()
assert calibrated.r_hat < 1.1
