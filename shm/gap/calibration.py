"""The two corrections after the evidence, as trials taught them: their numbers and provenance.

An effect's law may be off by a fraction of what it does (`shm.gap.law_error`), and a share of what
is not in the catalogue passes for an effect or a pair of it (`shm.gap.probabilities`). The numbers
stand in `calibration.toml`, which `tests/benchmarks/gap_calibration.py` writes.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple

from shm.errors import BadInput

FILE = Path(__file__).with_name("calibration.toml")


class Share(NamedTuple):
    """Probabilities that an effect's own law is off by so much, and that of something unknown."""

    own: float
    unknown: float


@dataclass(frozen=True)
class Provenance:
    """The trial that taught the values, and how many answers spoke for them."""

    trial: str
    seeds: str
    cases: str
    answers: str
    date: date
    command: str


@dataclass(frozen=True)
class Calibration:
    """The values, each explained in the file.

    `mimics_one` and `mimics_two` are shares of what is not in the catalogue; `exact` and `off_by`
    (by fraction) add to 1.
    """

    provenance: Provenance
    mimics_one: float
    mimics_two: float
    exact: Share
    off_by: Mapping[float, Share]


def read_calibration(file: Path = FILE) -> Calibration:
    """Return the values of a file; raises BadInput where it lacks one."""
    try:
        return _values(tomllib.loads(file.read_text(encoding="utf-8")))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BadInput(
            f"not a whole calibration ({error!r}).",
            file=file,
            remedy="Write it anew with tests/benchmarks/gap_calibration.py.",
        ) from error


def _values(told: dict[str, Any]) -> Calibration:
    mimic, law = told["mimic"], told["law"]
    return Calibration(
        provenance=Provenance(**told["provenance"]),
        mimics_one=mimic["one_effect"],
        mimics_two=mimic["two_effects"],
        exact=Share(**law["exact"]),
        off_by={each.pop("fraction"): Share(**each) for each in law["off"]},
    )


CALIBRATION = read_calibration()
