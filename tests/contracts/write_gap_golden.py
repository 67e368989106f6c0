"""Write the golden files of the contract of the gap diagnosis.

    python tests/contracts/write_gap_golden.py

`former.json` is not written: version 1.0.0 (7ac28baf) made it. Write a file again only where the
contract itself is changed, with a line in CHANGELOG.md; a file that is there is left as it is.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "cli")]

import numpy as np  # noqa: E402

from shm.bridge import load_hanger  # noqa: E402
from shm.documents import dump  # noqa: E402
from shm.modes_document import modes_document  # noqa: E402
from shm.simulate import HangerState, PlantedEffect  # noqa: E402
from shm.values import NAN, ModalTest  # noqa: E402
from tests.contracts import gap_calls as calls  # noqa: E402
from tests.contracts.golden_files import compress, shorten, write_missing  # noqa: E402
from tests.contracts.inference_calls import ROD  # noqa: E402
from tests.worlds.simulated.campaign import CampaignPlan, campaign  # noqa: E402

CLAMP = PlantedEffect("point_mass", "everywhere", {"mass_kg": 12.0, "x_m": 3.4})
SOFTER = PlantedEffect("bending_stiffness", "everywhere", {"stiffness_change": -0.2})
PLAN = CampaignPlan(modes=6, temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0)
NO_SHAPES = replace(PLAN, shapes=False)
ONE_PLANE = replace(NO_SHAPES, planes=("transverse",), modes=5)


def measure(plan: CampaignPlan, *effects: PlantedEffect) -> ModalTest:
    """Return the one test of a simulated campaign on hanger 3."""
    hanger, rng = load_hanger(ROD), np.random.default_rng(101)
    return campaign(hanger, HangerState(711e3), effects, plan, rng)[0]


def measure_all() -> dict[Path, ModalTest]:
    """Return the tests by their files."""
    clamped, wrong = measure(PLAN, CLAMP), measure(NO_SHAPES)
    bare = tuple(replace(mode, frequency_sd_hz=NAN) for mode in clamped.modes)
    modes = list(wrong.modes)
    modes[3] = replace(modes[3], frequency_hz=1.04 * modes[3].frequency_hz)
    return {
        calls.SOUND: measure(PLAN),
        calls.CLAMPED: clamped,
        calls.BARE: replace(clamped, modes=bare),
        calls.BLUNDER: replace(wrong, modes=tuple(modes)),
        calls.SOFT: measure(ONE_PLANE, SOFTER),
    }


def main() -> None:
    """Write each golden file that is missing."""
    made = {path: partial(modes_document, [test]) for path, test in measure_all().items()}
    made |= {
        calls.FOLDER / f"{name}.json": partial(f, calls.SEED) for name, f in calls.CASES.items()
    }
    made[calls.FOLDER / "effects.json"] = partial(calls.list_effects)
    write_missing(
        {
            path: lambda m=make: compress(dump(shorten(calls.read_back(m()))))
            for path, make in made.items()
        }
    )


if __name__ == "__main__":
    main()
