"""Infer the tension from frequencies that you type in.

Table 1.1 of the thesis: twelve frequencies of a 12 m round bar, without standard deviations. What
is not known (the deviations, the time, the temperature) is simply left out. The thesis leaves the
effective length open, and so do its priors.
"""

import shm
from shm.values import PLANES

hanger = shm.round_bar(
    3,
    diameter_m=0.130,
    length_m=12.0,
    elastic_modulus_pa=200e9,
    density_kg_m3=7800,
    nominal_tension_n=711e3,
)
measured_hz = {
    "transverse": (5.82, 13.85, 26.17, 40.47, 59.30, 81.30),
    "longitudinal": (6.09, 14.80, 27.00, 41.80, 61.50, 83.68),
}
# Shown in the manual from here.
test = shm.ModalTest(
    id="table 1.1",
    hanger=3,
    modes=tuple(
        shm.Mode(plane, order, frequency_hz)
        for plane in PLANES
        for order, frequency_hz in enumerate(measured_hz[plane], start=1)
    ),
)
posterior = shm.update(test, hanger, model="beam1", seed=1, priors="thesis")
figure = shm.plot.tension(posterior, hanger)
# Shown in the manual until here.
tension_kn = posterior.tension_n / 1e3
print(f"tension {tension_kn.mean():.0f} ± {tension_kn.std():.0f} kN")
print(f"model error {posterior.parameter('sigma').mean():.1%} of a frequency")

# A bar of bending stiffness EI is no string: the string's formula gives far too much.
string_n = hanger.mass_per_length_kg_m * (2 * hanger.length_m * measured_hz["transverse"][0]) ** 2
print(f"as a string: {string_n / 1e3:.0f} kN")

assert 750 < tension_kn.mean() < 900
assert string_n > 2 * posterior.tension_n.mean()
assert posterior.r_hat < 1.1
