"""Decide if the tension has fallen: two tests a year apart, of a hanger that lost 8 %.

The difference of two posteriors is a distribution of its own: the probability of a loss beyond 5 %
is the share of its draws that lie there.
"""

from datetime import UTC, datetime

import numpy as np

import shm

hanger = shm.round_bar(
    7,
    diameter_m=0.110,
    length_m=10.0,
    elastic_modulus_pa=205e9,
    density_kg_m3=7850,
    nominal_tension_n=600e3,
)
tests, posteriors = [], []
for year, tension_n in ((2025, 600e3), (2026, 552e3)):
    recording = shm.simulate(
        hanger,
        tension_n=tension_n,
        hits=3,
        seconds_per_hit=10.0,
        time=datetime(year, 5, 1, tzinfo=UTC),
        seed=year,
    )
    found = shm.identify(recording, hanger=hanger, test_id=str(year), cross_check="none")
    tests.append(found.test)
    posteriors.append(shm.update(found, hanger, model="beam1", seed=1))

# Shown in the manual from here.
before, after = (posterior.tension_n for posterior in posteriors)
change = after / before - 1
low, high = np.quantile(change, [0.05, 0.95])
beyond = np.mean(change < -0.05)
# Shown in the manual until here.
print(
    f"change {change.mean():+.1%} (90 % from {low:+.1%} to {high:+.1%}), "
    f"probability of more than 5 % lost: {beyond:.3f}"
)
figure = shm.plot.trend(posteriors, tests, hanger, baseline=posteriors[0])

assert abs(change.mean() + 0.08) < 0.005
assert beyond > 0.98
assert "tension (kN)" in figure.axes[0].get_ylabel()
