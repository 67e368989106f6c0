"""Read a workspace, as a daemon fills it, in a notebook.

The command line makes a workspace and takes in two modal tests; `shm.Store` then reads what it
keeps: the hangers, their tests, and the posterior of each.
"""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory

from matplotlib.figure import Figure

import shm
from shm.documents import dump
from shm.modes_document import modes_document
from shm_cli.main import run

BRIDGE = """
[bridge]
name = "Arch bridge"

[settings]
models = "beam1"
samples = 300
workers = 1

[[hanger]]
id = 3
diameter_m = 0.130
length_m = 12.0
elastic_modulus_pa = 200e9
density_kg_m3 = 7800
nominal_tension_n = 711e3
"""


def measured(hanger: shm.Hanger, tension_n: float, day: int) -> shm.ModalTest:
    """Simulate and identify the hammer test of one day."""
    time = datetime(2026, 5, 1, 10, tzinfo=UTC) + timedelta(days=day)
    recording = shm.simulate(hanger, tension_n=tension_n, time=time, seed=day)
    return replace(shm.identify(recording, hanger=hanger).test, id=f"day {day}")


def main() -> Figure:
    with TemporaryDirectory() as folder:
        described, modes = Path(folder) / "described.toml", Path(folder) / "hanger3.modes.json"
        arch = Path(folder) / "arch"
        described.write_text(BRIDGE)
        hanger = shm.load_hanger(described)
        tests = [measured(hanger, 711e3, 0), measured(hanger, 700e3, 30)]
        modes.write_text(dump(modes_document(tests)))
        assert run(["init", str(arch), "--from", str(described)]) == 0
        assert run(["--workspace", str(arch), "ingest", str(modes)]) == 0

        # Shown in the manual from here.
        with shm.Store(arch) as store:
            stored = store.tests(3)
            tensions = store.tensions(3)
            now = store.tension(3).tension_n
            posteriors = store.posteriors(3)
            selection = store.selection(3)
            figure = shm.plot.trend(posteriors, stored, store.hanger(3))
        # Shown in the manual until here.

    for test in stored:
        tension = tensions[test.id].tension_n
        interval = f"90 % interval {tension.q05 / 1e3:.0f} to {tension.q95 / 1e3:.0f} kN"
        print(f"{test.time:%Y-%m-%d}: {tension.mean / 1e3:.0f} kN, {interval}")

    assert [test.id for test in stored] == ["day 0", "day 30"]
    assert selection.selected.model == "beam1"
    assert tensions["day 30"].tension_n.q05 < 700e3 < tensions["day 30"].tension_n.q95
    assert now.q05 < 700e3 < now.q95
    assert abs(posteriors[0].tension_n.mean() / 711e3 - 1) < 0.005
    assert abs(posteriors[1].tension_n.mean() / 700e3 - 1) < 0.005
    assert figure.axes[0].get_xlabel() == "time of the test (UTC)"
    return figure


# The command line works in processes of its own, which import this file again.
if __name__ == "__main__":
    figure = main()
