"""What a file holds, before anybody has said what it does not say: every column, and its layout.

Files of one logger have one layout: the words of its heading and of its columns, not what they hold
this time. By its fingerprint a logger's profile is found (`shm.read.profiles`).
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from shm.values import NAN, FloatArray, Plane, Quantity


@dataclass(frozen=True, eq=False)
class SurveyedColumn:
    """A column of a file, and what is known of it.

    `values` (samples,) are as recorded, in `unit` ("" where the file says none), None where the
    file is none of time records; `overloads` of them were beyond the range. `quantity` is what it
    counts as, None where it is left out, `meant` what its name alone suggests. `calibration` is in
    `unit` per recorded unit.
    """

    name: str
    unit: str
    values: FloatArray | None
    overloads: int = 0
    quantity: Quantity | None = None
    meant: Quantity | None = None
    plane: Plane | None = None
    x_m: float = NAN
    calibration: float = NAN
    full_scale: float = NAN
    described_unit: str = ""


@dataclass(frozen=True, eq=False)
class Survey:
    """A file as found: NaN and None where it does not say.

    `problems` are what would be refused as it is; `lines` counts those of frequency responses.
    """

    source: str
    format: str
    columns: tuple[SurveyedColumn, ...]
    samples: int
    sampling_rate_hz: float
    hanger: int | None
    time: datetime | None
    temperature_c: float
    layout: Layout
    lines: int = 0
    remarks: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Layout:
    """How the files of one logger look, and what this one says of itself.

    `hanger` and `says_rate` are what a profile must not say in its stead.
    """

    fingerprint: str
    format: str
    columns: tuple[str, ...]
    hanger: int | None = None
    says_rate: bool = False
