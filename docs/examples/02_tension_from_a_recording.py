"""Find the tension from a hammer recording, and compare it with the known truth.

A recording of five hits is simulated by finite elements in the time domain (no code is shared with
the models that find the tension again), written as CSV, read, identified and updated.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import shm
from shm.read import write

hanger = shm.round_bar(
    3,
    diameter_m=0.130,
    length_m=12.0,
    elastic_modulus_pa=200e9,
    density_kg_m3=7800,
    nominal_tension_n=711e3,
)
truth_n = 650e3
planted = shm.simulate(hanger, tension_n=truth_n, seed=1)

with TemporaryDirectory() as folder:
    path = Path(folder) / "hanger3.csv"
    write(planted, path)
    recording = shm.read(path)

# Shown in the manual from here.
test = shm.identify(recording, hanger=hanger)
print(test.test.summary())

posterior = shm.update(test, hanger, model="beam1", seed=1)
print(posterior.summary())

figure = shm.plot.frequency_response(test, hanger)
# Shown in the manual until here.

assert len(test.test.modes) == 12  # six in each plane below 100 Hz
assert abs(posterior.tension_n.mean() - truth_n) < 3 * posterior.tension_n.std()
assert posterior.tension_n.std() / truth_n < 0.03  # the bar as made: mass, stiffness, length
assert posterior.repeatability_sd_n / truth_n < 0.002
assert figure.axes[0].get_ylabel().endswith("(m/s²/N)")
