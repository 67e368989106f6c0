"""Write the golden files of the contract of the gap diagnosis.

    python tests/contracts/write_gap_golden.py

`former.json` is not written: version 1.0.0 made it. Write a file again only where the contract
itself is changed, with a line in CHANGELOG.md; a golden file that is there is left as it is.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "cli")]

import numpy as np  # noqa: E402

from shm.bridge import load_hanger  # noqa: E402
from shm.documents import dump  # noqa: E402
from shm.modes_document import modes_document  # noqa: E402
from shm.simulate import HangerState, PlantedEffect  # noqa: E402
from shm.values import NAN, ModalTest  # noqa: E402
from tests.contracts import gap_calls as calls  # noqa: E402
from tests.contracts import inference_calls  # noqa: E402
from tests.contracts.write_inference_golden import compress, shorten  # noqa: E402
from tests.worlds.simulated.campaign import CampaignPlan, campaign  # noqa: E402

SEED = 11
CLAMP = PlantedEffect("point_mass", "everywhere", {"mass_kg": 12.0, "x_m": 3.4})
SOFTER = PlantedEffect("bending_stiffness", "everywhere", {"stiffness_change": -0.2})
BOTH_PLANES = CampaignPlan(modes=6, temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0)
ONE_PLANE = replace(BOTH_PLANES, planes=("transverse",), modes=5, shapes=False)


def measure(plan: CampaignPlan, *effects: PlantedEffect) -> ModalTest:
    """Return the one test of a simulated campaign on hanger 3."""
    rng = np.random.default_rng(101)
    (test,) = campaign(load_hanger(calls.ROD), HangerState(711e3), effects, plan, rng)
    return test


def bare() -> ModalTest:
    """Return the clamped hanger's test without standard deviations of frequencies."""
    test = measure(BOTH_PLANES, CLAMP)
    modes = tuple(replace(mode, frequency_sd_hz=NAN) for mode in test.modes)
    return replace(test, modes=modes)


def blunder() -> ModalTest:
    """Return the sound hanger's frequencies, the fourth 4 % too high."""
    test = measure(replace(BOTH_PLANES, shapes=False))
    modes = list(test.modes)
    modes[3] = replace(modes[3], frequency_hz=1.04 * modes[3].frequency_hz)
    return replace(test, modes=tuple(modes))


INPUTS: dict[Path, Callable[[], ModalTest]] = {
    calls.SOUND: lambda: measure(BOTH_PLANES),
    calls.CLAMPED: lambda: measure(BOTH_PLANES, CLAMP),
    calls.BARE: bare,
    calls.BLUNDER: blunder,
    calls.SOFT: lambda: measure(ONE_PLANE, SOFTER),
}


def write(path: Path, make: Callable[[], object]) -> None:
    """Write a golden file that is missing."""
    if not path.exists():
        started = process_time()
        path.write_text(compress(dump(shorten(make()))), encoding="utf-8")
        took = process_time() - started
        print(f"{path.name}: {path.stat().st_size / 1000:.1f} kB, {took:.1f} s")


def main() -> None:
    """Write each golden file that is missing."""
    for path, test in INPUTS.items():
        write(path, lambda test=test: json.loads(dump(modes_document([test()]))))  # type: ignore[misc]
    for name, case in calls.CASES.items():
        write(calls.GOLDEN / f"{name}.json", lambda case=case: case(SEED))  # type: ignore[misc]
    effects = inference_calls.call("gap", "effects", "--json").document
    write(calls.GOLDEN / "effects.json", lambda: effects)


if __name__ == "__main__":
    main()
