"""Compute the frequencies of a model class, and compare them with a closed form.

A clamped bar without bending stiffness is a string: f_n = n / (2 L) sqrt(T / m). A model class is a
name; `build` makes it for a hanger, with the thesis's priors of tension and length alone. Its array
of parameter sets (n, parameters) gives frequencies (n, planes, modes) in one call.
"""

from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

import shm
from shm.models import MODELS, build

bar = shm.round_bar(
    3,
    diameter_m=0.130,
    length_m=12.0,
    elastic_modulus_pa=200e9,
    density_kg_m3=7800,
    nominal_tension_n=711e3,
)
string = replace(bar, bending_stiffness_factor=1e-6)
order = np.arange(1, 5)
closed_form_hz = order / (2 * bar.length_m) * np.sqrt(711e3 / bar.mass_per_length_kg_m)

# Shown in the manual from here.
parameters = np.array([[1.0, 1.0], [1.1, 1.0]])  # theta_F, theta_L
as_string = build("beam1", string, priors="thesis").frequencies_hz(parameters, modes=4)
as_bar = build("beam1", bar, priors="thesis").frequencies_hz(parameters, modes=4)
# Shown in the manual until here.

ratio = np.linspace(0.2, 1.5, 40)
tensions = build("beam1", bar, priors="thesis").frequencies_hz(
    np.column_stack([ratio, np.ones_like(ratio)]), modes=4
)
figure = Figure(layout="constrained")
axes = figure.subplots()
axes.plot(711 * ratio, tensions[:, 0], label=[f"mode {n}" for n in order])
axes.set(xlabel="tension (kN)", ylabel="frequency (Hz)")
axes.legend()
print("model classes:", ", ".join(MODELS))
print("string, closed form (Hz):", closed_form_hz.round(3))
print("string, beam1       (Hz):", as_string[0, 0].round(3))
print("bar, beam1          (Hz):", as_bar[0, 0].round(3))

assert np.allclose(as_string[0, 0], closed_form_hz, rtol=2e-3)
assert np.allclose(as_string[1] / as_string[0], np.sqrt(1.1), rtol=1e-3)
assert (as_bar[1] / as_bar[0] < np.sqrt(1.1)).all()  # bending stiffness does not care for tension
assert as_bar.shape == (2, 2, 4)
