"""Use the posterior in ArviZ, with the likelihood of each measurement.

Needs `pip install 'shm[arviz]'`; then `arviz.summary`, `arviz.loo`, `arviz.plot_ppc` take it.
"""

import numpy as np
from matplotlib.figure import Figure

import shm

hanger = shm.round_bar(
    3,
    diameter_m=0.130,
    length_m=12.0,
    elastic_modulus_pa=200e9,
    density_kg_m3=7800,
    nominal_tension_n=711e3,
)
recording = shm.simulate(hanger, hits=3, seconds_per_hit=10.0, seed=5)
test = shm.identify(recording, hanger=hanger, cross_check="none")
posterior = shm.update(test, hanger, model="beam1", samples=500, seed=1, priors="thesis")

# Shown in the manual from here.
tree = posterior.to_arviz([test.test], hanger)

tension = tree["posterior"]["tension_n"]
length = tree["posterior"]["theta_L"]
# Shown in the manual until here.
figure = Figure(layout="constrained")
axes = figure.subplots()
axes.scatter(length, tension / 1e3, s=4)
axes.set(xlabel="effective over described length", ylabel="tension (kN)")
print(f"tension {float(tension.mean()):.0f} {tension.attrs['units']}")
replicated = tree["posterior_predictive"]["frequency_hz"]
observed = tree["observed_data"]["frequency_hz"]
low, high = replicated.quantile([0.025, 0.975], dim=("chain", "draw"))
inside = float(((observed > low) & (observed < high)).mean())
print(f"{inside:.0%} of the measured frequencies lie within 95 % of what the model predicts")

assert tension.dims == ("chain", "draw")
assert tension.attrs["units"] == "N"
assert np.array_equal(tension.values[0], posterior.tension_n)
assert inside > 0.8
pointwise = tree["log_likelihood"]["frequency_hz"].sum("measurement").values[0]
assert np.allclose(pointwise, posterior.log_likelihood)
