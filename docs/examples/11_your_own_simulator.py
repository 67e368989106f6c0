"""Find out why readings differ from your own simulator, by effects that you list.

A spring of unknown stiffness is pulled to five lengths. In truth it has a pretension, which the
simulator does not know; the catalogue has that and two rivals.
"""

import numpy as np
from matplotlib.figure import Figure

import shm


def spring(p, at):
    """Return the force of a spring, in newtons, with the effects that `p` holds."""
    x_m = at["x_m"]
    force_n = p["k_n_m"] * x_m * (1 + p.get("hardening_m2", 0.0) * x_m**2)
    return {"force_n": force_n * (1 + p.get("per_kelvin", 0.0) * at["warm_k"]) + p.get("f0_n", 0.0)}


def effect(name, **parameters):
    return shm.SimulatorEffect(name, parameters, spring)


# Shown in the manual from here.
simulator = shm.Simulator(
    spring,
    {"k_n_m": shm.Prior("lognormal", 200.0, 0.1)},
    [
        effect("pretension", f0_n=shm.Prior("logarithmic", 0.05, 10.0)),
        effect("hardening", hardening_m2=shm.Prior("logarithmic", 0.5, 500.0)),
        effect("warm_softening", per_kelvin=shm.Prior("uniform", -0.01, 0.0)),
    ],
    vectorised=True,
)
# Shown in the manual until here.
rng = np.random.default_rng(1)
readings = [
    shm.Reading(
        {"x_m": x_m, "warm_k": warm_k},
        "force_n",
        value=210.0 * x_m + 2.0 + 0.1 * rng.standard_normal(),
        sd=0.1,
    )
    for x_m in (0.02, 0.04, 0.06, 0.08, 0.1)
    for warm_k in (0.0, 15.0)
]
answer = shm.diagnose_simulator(simulator, readings, candidates=[{"x_m": 0.0, "warm_k": 0.0}])
print(answer.summary())
figure = Figure(layout="constrained")
axes = figure.subplots()
axes.barh([each.name for each in answer.causes], [each.probability for each in answer.causes])
axes.set(xlabel="probability")

assert answer.named == ("pretension",)
assert answer.no_gap_probability < 0.01
assert answer.shrinkage.held_out_after < answer.shrinkage.held_out_before / 3
