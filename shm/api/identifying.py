"""From the records of a test to its modes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, TypeAlias

from shm.errors import BadInput, UsageError
from shm.identify import Identification, IdentifyOptions
from shm.identify.identification import identify as identified
from shm.settings import Settings
from shm.values import FrequencyResponse, Hanger, Recording

Record: TypeAlias = Recording | FrequencyResponse
_DEFAULT = Settings()


def identify(
    records: Record | Sequence[Record],
    *,
    hanger: Hanger | None = None,
    test_id: str | None = None,
    band_hz: tuple[float, float] = (_DEFAULT.band_low_hz, _DEFAULT.band_high_hz),
    identifier: str = _DEFAULT.identifier,
    cross_check: str = _DEFAULT.cross_check,
    estimator: Literal["h1", "h2", "hv"] = "h1",
    reference_force_n: float = _DEFAULT.reference_force_n,
    frequency_allowance: float = _DEFAULT.frequency_allowance,
    mains_hz: float = _DEFAULT.mains_hz,
    window_time_constant_s: float = math.inf,
) -> Identification:
    """The modes of one test, each with its standard deviations, and how they were found.

    `records` are those of one test: hits, set-ups, or frequency responses. The description of the
    `hanger`, where known, helps to number the modes. `test_id` names the test; left out, the name
    of its first file. Modes are looked for within `band_hz`. `identifier` and `cross_check` are
    names of `shm.identify.IDENTIFIERS` (`ssi`, `ssi-input`, `frf`; the latter also `none`).
    `estimator` of the frequency response allows for noise in the responses (`h1`), the force
    (`h2`) or both (`hv`). A hit of `reference_force_n` has amplitude 1. `frequency_allowance` is
    the part of a frequency by which it differs from test to test unseen. `window_time_constant_s`
    is that of an exponential window already in given frequency responses.

    `Identification.test` holds the modes; beside it stand quality, hits, the frequency response and
    what was dropped and why. Raises BadInput where the records cannot be used together or are of
    another hanger, NotIdentifiable where no mode can be trusted, UsageError for an unknown name.

    Example:
        >>> test = shm.identify(shm.read("hanger3.csv"), hanger=hanger)
        >>> [(mode.plane, mode.order, mode.frequency_hz) for mode in test.test.modes[:2]]
        [('transverse', 1, 5.83), ('transverse', 2, 14.17)]
    """
    given = [records] if isinstance(records, Recording | FrequencyResponse) else list(records)
    if not given:
        raise UsageError("no record to identify modes in.", remedy="Give at least one.")
    options = IdentifyOptions(
        band_low_hz=band_hz[0],
        band_high_hz=band_hz[1],
        identifier=identifier,
        cross_check=cross_check,
        estimator=estimator,
        reference_force_n=reference_force_n,
        frequency_allowance=frequency_allowance,
        mains_hz=mains_hz,
        window_time_constant_s=window_time_constant_s,
    )
    name = test_id or Path(given[0].source).stem
    found = identified(given, options, test_id=name, hanger=hanger)
    return found if hanger is None else _of(found, hanger, given[0].source)


def _of(found: Identification, hanger: Hanger, source: str) -> Identification:
    """The test as one of `hanger`, where its records do not say that it is of another."""
    named = found.test.hanger
    if named not in (None, hanger.id):
        raise BadInput(
            f"the file says hanger {named}, the description is of hanger {hanger.id}.",
            file=source,
            remedy="Give the description of its hanger, or correct the file.",
        )
    return replace(found, test=replace(found.test, hanger=hanger.id))
