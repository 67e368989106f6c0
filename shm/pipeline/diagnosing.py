"""The diagnosis of a hanger's latest stored tests, which the store keeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime
from typing import TYPE_CHECKING

from shm.errors import NothingThere
from shm.inference.options import Progress, silent
from shm.pipeline.lineage import diagnosis_lineage
from shm.store import Store, StoredTest
from shm.values import Diagnosis, Hanger

if TYPE_CHECKING:
    from shm.gap import GapOptions

LATEST_TESTS = 20
"""So many of the latest tests are diagnosed together."""


def latest_tests(store: Store, hanger: Hanger, count: int) -> Sequence[StoredTest]:
    """Return so many at most, the latest last; raise NothingThere where there is none."""
    if not (stored := store.tests.list_all(hanger.id)[-count:]):
        raise NothingThere(
            f"no test of hanger {hanger.id} is stored.", remedy="Take one in with `shm ingest`."
        )
    return stored


def diagnose_stored(
    store: Store,
    stored: Sequence[StoredTest],
    hanger: Hanger,
    options: GapOptions,
    now: datetime,
    progress: Progress = silent,
) -> Diagnosis:
    """Diagnose stored tests of a hanger, keep the diagnosis and return it.

    Raises as `shm.gap.diagnose` does.
    """
    from shm.gap import diagnose  # only who diagnoses needs it

    found = diagnose([each.test for each in stored], hanger, options, progress)
    lineage = diagnosis_lineage(stored, hanger, asdict(options))
    store.posteriors.save_diagnosis(hanger.id, found, lineage, now)
    return found
