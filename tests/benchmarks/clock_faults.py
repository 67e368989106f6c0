"""How often a loss of a tenth is told of by its second test, whatever the logger's clock says.

`python tests/benchmarks/clock_faults.py 50`: so many bridges a fault, of all faults or those named.
"""

from __future__ import annotations

import argparse
import logging
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.helpers import quick_update
from tests.helpers.clock_faults import FAULTS, one_case


def main() -> None:
    logging.disable(logging.WARNING)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("number", nargs="?", type=int, default=50)
    parser.add_argument("faults", nargs="*", default=list(FAULTS))
    asked = parser.parse_args()
    number = asked.number
    quick_update.stand_in(setattr)
    for fault in asked.faults:
        with TemporaryDirectory() as folder:
            found = [one_case(fault, seed, Path(folder)) for seed in range(number)]
        told = sum(each.told for each in found)
        missed = [seed for seed, each in enumerate(found) if not each.told]
        held = sum(each.good_held for each in found)
        print(
            f"{fault}: told {told} of {number}, good tests held {held}, missed {missed}", flush=True
        )


if __name__ == "__main__":
    main()
