"""Use posterior draws and modes as pandas tables, and write them to files.

Any quantity of a model is a function of the draws: here the safety of the bar against yielding.
"""

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas
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
recording = shm.simulate(hanger, hits=3, seconds_per_hit=10.0, temperature_c=12.0, seed=4)
test = shm.identify(recording, hanger=hanger, cross_check="none")
posterior = shm.update(test, hanger, model="beam1", samples=500, seed=1)

modes = test.test.to_dataframe()
print(modes[["plane", "order", "frequency_hz", "frequency_sd_hz"]].to_string(index=False))

# Shown in the manual from here.
table = posterior.to_dataframe()
table["stress_mpa"] = table["tension_n"] / hanger.area_m2 / 1e6
safety = 355 / table["stress_mpa"]
# Shown in the manual until here.
figure = Figure(layout="constrained")
axes = figure.subplots()
axes.hist(table["stress_mpa"], bins=30)
axes.set(xlabel="stress (MPa)", ylabel="draws")
print(f"stress {table['stress_mpa'].mean():.2f} MPa, safety {safety.quantile(0.05):.2f} at least")

with TemporaryDirectory() as folder:
    shm.export.write(posterior, Path(folder) / "hanger3.csv")
    shm.export.write(posterior, Path(folder) / "hanger3.json")
    back = pandas.read_csv(Path(folder) / "hanger3.csv")
    document = json.loads((Path(folder) / "hanger3.json").read_text())

assert list(back.columns) == [*posterior.names, "tension_n", "log_likelihood"]
assert (back["tension_n"] == table["tension_n"]).all()
assert document["draws"]["tension_n"] == table["tension_n"].tolist()
assert modes.groupby("plane")["order"].max().to_dict() == {"longitudinal": 6, "transverse": 6}
assert abs(table["stress_mpa"].mean() / (711e3 / hanger.area_m2 / 1e6) - 1) < 0.03
