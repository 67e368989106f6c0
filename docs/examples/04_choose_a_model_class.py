"""Choose a model class by its evidence, which pays for fit and charges for freedom.

One bar is clamped, another turns in a soft bearing at its deck end. The evidence takes the clamped
model (`beam1`) for the first and the one with springs (`beam2`) for the second; a wrong class gives
a wrong tension, and says so by its evidence and its model error.
"""

from matplotlib.figure import Figure

import shm

hanger = shm.round_bar(
    7,
    diameter_m=0.110,
    length_m=10.0,
    elastic_modulus_pa=205e9,
    density_kg_m3=7850,
    nominal_tension_n=600e3,
)


def selected(spring_n_m_rad: float) -> shm.Selection:
    """Return the choice for a bar of 600 kN with a rotational spring at its deck end."""
    recording = shm.simulate(
        hanger,
        k1_n_m_rad=spring_n_m_rad,
        k2_n_m_rad=spring_n_m_rad,
        hits=3,
        seconds_per_hit=10.0,
        seed=2,
    )
    # Shown in the manual from here.
    test = shm.identify(recording, hanger=hanger, cross_check="none")
    return shm.select(test, hanger, models=["beam1", "beam2"], samples=500, seed=1)
    # Shown in the manual until here.


clamped, soft = selected(float("inf")), selected(2e6)
for name, choice in (("clamped", clamped), ("turning", soft)):
    for posterior, probability in zip(choice.posteriors, choice.probabilities, strict=True):
        print(
            f"{name} deck end, {posterior.model}: probability {probability:.3f}, "
            f"tension {posterior.tension_n.mean() / 1e3:.1f} kN"
        )

figure = Figure(layout="constrained")
for axes, posterior in zip(figure.subplots(2, 1, sharex=True), soft.posteriors, strict=True):
    shm.plot.tension(posterior, hanger, ax=axes)
    axes.set_xlabel(f"tension (kN), turning deck end, {posterior.model}")

assert soft.selected.model == "beam2"
assert soft.probabilities[0] > 0.99
soft_n = soft.averaged.tension_n
assert abs(soft_n.mean - 600e3) < 3 * soft_n.sd
clamped_n = clamped.averaged.tension_n
assert abs(clamped_n.mean - 600e3) < 3 * clamped_n.sd
