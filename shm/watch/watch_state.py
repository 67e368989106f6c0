"""What the watch of one hanger goes on from: all that its next result rests on, kept as a file."""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any

import numpy as np

from shm.errors import BadInput
from shm.values import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class WatchState:
    """All that the next result rests on, of T tests so far, in plain arrays.

    It goes on only where `key` is that of the watch which is to go on. `told` is text that goes
    with it, `still_same` the probability that nothing had changed before the last call.
    `weight` (T,) is what is left of tests that alone would say more than one test may.
    `called` (calls, 3) are the first test, years, and whether it is a ramp, `called_precision`
    (calls, n + q, n + q) what called it. `scatter_variance` is what tests scatter by.
    """

    key: str
    start: datetime
    last_time: datetime
    reference_c: float
    values: FloatArray
    variances: FloatArray
    slopes: FloatArray
    per_kelvin: FloatArray
    years: FloatArray
    temperature_c: FloatArray
    log_amplitude: FloatArray
    weight: FloatArray
    counted: BoolArray
    coefficients: FloatArray
    coefficient_sd: FloatArray
    scatter_variance: FloatArray
    called: FloatArray
    called_precision: FloatArray
    still_same: float = 1.0
    told: str = ""

    @classmethod
    def before_any(
        cls,
        key: str,
        start: datetime,
        reference_c: float,
        sizes: tuple[int, int],
        coefficient_sd: FloatArray,
        scatter_variance: FloatArray,
    ) -> WatchState:
        """Of no test yet; `sizes` are how many modes and quantities there are."""
        n, q = sizes
        return cls(
            key=key,
            start=start,
            last_time=start,
            reference_c=reference_c,
            values=np.zeros((0, n)),
            variances=np.zeros((0, n)),
            slopes=np.zeros((0, n, q)),
            per_kelvin=np.zeros((0, n)),
            years=np.zeros(0),
            temperature_c=np.zeros(0),
            log_amplitude=np.zeros(0),
            weight=np.zeros(0),
            counted=np.zeros(0, bool),
            coefficients=np.zeros(len(coefficient_sd)),
            coefficient_sd=coefficient_sd,
            scatter_variance=scatter_variance,
            called=np.zeros((0, 3)),
            called_precision=np.zeros((0, n + q, n + q)),
        )

    @property
    def tests(self) -> int:
        return len(self.years)

    def to_bytes(self) -> bytes:
        """The state as a file of numpy arrays, without any pickled object."""
        kept = io.BytesIO()
        plain: dict[str, Any] = {
            each.name: np.asarray(value.isoformat() if isinstance(value, datetime) else value)
            for each in fields(self)
            for value in [getattr(self, each.name)]
        }
        np.savez_compressed(kept, **plain)
        return kept.getvalue()

    @classmethod
    def from_bytes(cls, content: bytes) -> WatchState:
        """The state back; raises BadInput where the content is no such state."""
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as kept:
                found = dict(kept)
            for name in ("key", "told"):
                found[name] = str(found[name])
            for name in ("start", "last_time"):
                found[name] = datetime.fromisoformat(str(found[name]))
            for name in ("reference_c", "still_same"):
                found[name] = float(found[name])
            return cls(**found)
        except (ValueError, KeyError, TypeError, EOFError, OSError, zipfile.BadZipFile) as error:
            raise BadInput(
                f"A kept state of the watch cannot be read: {error}.",
                remedy="Drop it: the watch then goes over all tests again.",
            ) from error
