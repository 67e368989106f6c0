"""Why do model and measurement differ? A lamp of 60 kg hangs on the bar, and nobody noted it.

Modal tests of a campaign are simulated with the lamp. The diagnosis weighs every effect of its
catalogue, no gap at all, and something that the catalogue lacks.
"""

import numpy as np

import shm
from shm.simulate import CampaignPlan, HangerState, campaign

hanger = shm.round_bar(
    3,
    diameter_m=0.130,
    length_m=12.0,
    elastic_modulus_pa=200e9,
    density_kg_m3=7800,
    nominal_tension_n=711e3,
)
lamp = shm.PlantedEffect("point_mass", "everywhere", {"mass_kg": 60.0, "x_m": 3.4})
plan, rng = CampaignPlan(modes=6), np.random.default_rng(1)
tests = campaign(hanger, HangerState(711e3), [lamp], plan, rng)

diagnosis = shm.diagnose(tests[:1], hanger, draws=200, seed=1)
cause = diagnosis.leading
assert cause is not None
print(diagnosis.summary())

found = {estimate.name: estimate for estimate in cause.parameters}
assert cause.effect == "point_mass"
assert abs(found["mass_kg"].mean - 60.0) < 4 * found["mass_kg"].sd
assert abs(found["x_m"].mean - 3.4) < 0.05
assert diagnosis.shrinkage.rms_after_percent < diagnosis.shrinkage.rms_before_percent / 5
