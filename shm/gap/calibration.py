"""What trials taught the diagnosis: one data file, `calibration.toml`, with its trial and command.

How often effects imitate what is not in the catalogue, how far their laws are off, what a minor
second cause and a free remainder mostly are. `tests/benchmarks/gap_calibration.py` writes the file.
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
    """Prior probabilities: that an effect's own law is off by so much, and that something unknown
    is that passes for it."""

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

    `mimics_one` and `mimics_two` are shares of what is not in the catalogue; `in_mimicking_pairs`
    and `with_turned_sensors` count the pairs in which each effect led falsely. `exact`, `of_a_mode`
    and `on_the_whole` (by fraction) add to 1, and so does `where_rough`.
    """

    provenance: Provenance
    mimics_one: float
    mimics_two: float
    in_mimicking_pairs: Mapping[str, int]
    with_turned_sensors: Mapping[str, int]
    undetected_share: float
    minor_below: float
    minor_law_odds: float
    exact: Share
    of_a_mode: Mapping[float, Share]
    on_the_whole: Mapping[float, Share]
    rough: float
    where_rough: Mapping[float, float]

    @property
    def mimicking_pairs(self) -> int:
        """All pairs that led falsely."""
        return sum(self.in_mimicking_pairs.values()) // 2 + sum(self.with_turned_sensors.values())


def read_calibration(file: Path = FILE) -> Calibration:
    """The values of a file; raises BadInput where it lacks one."""
    try:
        return _values(tomllib.loads(file.read_text(encoding="utf-8")))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BadInput(
            f"not a whole calibration ({error!r}).",
            file=file,
            remedy="Write it anew with tests/benchmarks/gap_calibration.py.",
        ) from error


def _values(told: dict[str, Any]) -> Calibration:
    mimic, law, rough = told["mimic"], told["law"], told["rough_law"]
    return Calibration(
        provenance=Provenance(**told["provenance"]),
        mimics_one=mimic["one_effect"],
        mimics_two=mimic["two_effects"],
        in_mimicking_pairs=mimic["in_pairs"],
        with_turned_sensors=mimic["with_turned_sensors"],
        undetected_share=told["undetected"]["share"],
        minor_below=told["minor"]["below"],
        minor_law_odds=float(told["minor"]["law_odds"]),
        exact=Share(**law["exact"]),
        of_a_mode={each.pop("fraction"): Share(**each) for each in law["of_a_mode"]},
        on_the_whole={each.pop("fraction"): Share(**each) for each in law["on_the_whole"]},
        rough=rough["probability"],
        where_rough={each["fraction"]: each["share"] for each in rough["of_a_mode"]},
    )


CALIBRATION = read_calibration()
