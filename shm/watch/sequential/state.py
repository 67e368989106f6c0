"""The state of a watch between two tests: all that the next result rests on, in plain arrays.

It is kept in numpy's own format, without any pickled object, so that what is read back can be
nothing but numbers and text.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from shm.errors import BadInput
from shm.values import FloatArray
from shm.watch.sequential.bank import Bank, Beginning
from shm.watch.sequential.design import Design, Direction, Warmth
from shm.watch.sequential.filtering import Filters


@dataclass(frozen=True, eq=False)
class WatchState:
    """After `tests` readings, the last of them made at `last_time`, the first at `start`.

    It goes on only where `key` is that of the watch which is to go on, else the watch begins anew;
    after which tests it was kept, who keeps it knows. `told` is text that goes with it.
    `still_same` is the probability that nothing had changed before the last call.
    """

    key: str
    tests: int
    start: datetime
    last_time: datetime
    bank: Bank
    warmth: Warmth
    still_same: float
    told: str = ""

    def to_bytes(self) -> bytes:
        """The state as a file of numpy arrays."""
        kept = io.BytesIO()
        np.savez_compressed(kept, **_arrays(self))
        return kept.getvalue()

    @classmethod
    def from_bytes(cls, content: bytes) -> WatchState:
        """The state back; raises BadInput where the content is no such state."""
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as kept:
                return _state(dict(kept))
        except (ValueError, KeyError, IndexError, EOFError, OSError, zipfile.BadZipFile) as error:
            raise BadInput(
                f"A kept state of the watch cannot be read: {error}.",
                remedy="Drop it: the watch then goes over all tests again.",
            ) from error


def _arrays(state: WatchState) -> dict[str, Any]:
    bank, design, warmth = state.bank, state.bank.design, state.warmth
    return {
        "texts": np.array([state.key, state.told]),
        "times": np.array([state.start.isoformat(), state.last_time.isoformat()]),
        "counts": np.array([state.tests, bank.scatters, design.q]),
        "numbers": np.array(
            [
                state.still_same,
                bank.years,
                bank.log_choices,
                design.since_years,
                warmth.reference_c,
            ]
        ),
        "jumps": np.array(design.jumps, dtype=np.int64),
        "rates": np.array(design.rates, dtype=np.int64),
        "roots": np.array([_padded(each.root) for each in bank.directions]),
        "mean": bank.filters.mean,
        "covariance": bank.filters.covariance,
        "scatter": bank.filters.scatter,
        "log_mass": bank.log_mass,
        "called": bank.called,
        "beginnings": np.array(
            [(each.after_years, each.by_years, each.ramp_years) for each in bank.beginnings]
        ).reshape(-1, 3),
        "known_k": warmth.known_k,
        "unknown_years": warmth.unknown_years,
    }


def _state(arrays: Mapping[str, Any]) -> WatchState:
    key, told = arrays["texts"].tolist()
    start, last_time = (datetime.fromisoformat(each) for each in arrays["times"].tolist())
    tests, _, _ = arrays["counts"].tolist()
    still_same, *_, reference_c = arrays["numbers"].tolist()
    warmth = Warmth(reference_c, arrays["known_k"], arrays["unknown_years"])
    return WatchState(key, tests, start, last_time, _bank(arrays), warmth, still_same, told)


def _bank(arrays: Mapping[str, Any]) -> Bank:
    """The bank; by which filter the last test was an outlier is not kept, and nothing rests on."""
    _, scatters, q = arrays["counts"].tolist()
    _, years, log_choices, since_years, _ = arrays["numbers"].tolist()
    jumps, rates = (tuple(arrays[name].tolist()) for name in ("jumps", "rates"))
    return Bank(
        design=Design(q, jumps, rates, since_years),
        directions=tuple(_direction(root) for root in arrays["roots"]),
        scatters=scatters,
        filters=Filters(arrays["mean"], arrays["covariance"], arrays["scatter"]),
        log_mass=arrays["log_mass"],
        years=years,
        log_choices=log_choices,
        called=arrays["called"],
        beginnings=tuple(Beginning(*each) for each in arrays["beginnings"].tolist()),
    )


def _padded(root: FloatArray) -> FloatArray:
    """The factor of a direction with a column for each quantity (q, q)."""
    return np.pad(root, ((0, 0), (0, len(root) - root.shape[1])))


def _direction(root: FloatArray) -> Direction:
    members = tuple(np.flatnonzero(root.any(axis=1)).tolist())
    return Direction(members, root[:, : len(members)])
