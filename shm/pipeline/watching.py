"""Which tests of a hanger the watch goes over.

Nothing here imports what computes, so that the daemon itself begins quickly and stays small.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shm.store import Baseline, Stage, Store, StoredTest

if TYPE_CHECKING:
    from shm.watch import DatedTest

MOST_TESTS = 500
"""So many of the latest tests are gone over beside those of the baseline."""


def dated_tests(
    store: Store, baseline: Baseline, last: StoredTest | None = None
) -> tuple[list[DatedTest], list[DatedTest]]:
    """The tests of a baseline, and those since that were watched, up to and with `last`; by time.

    Tests that were watched against an earlier baseline count, but for those before a day since
    which the hanger is compared anew.
    """
    of_baseline, later = [], []
    for each in store.tests(baseline.hanger):
        if each.test.id in baseline.posterior.tests:
            of_baseline.append(each)
        elif _counts(each, baseline, last):
            later.append(each)
    return _dated(of_baseline), _dated([*later, *([last] if last else [])][-MOST_TESTS:])


def _counts(test: StoredTest, baseline: Baseline, last: StoredTest | None) -> bool:
    if test.stage is not Stage.WATCHED or (baseline.since and test.time < baseline.since):
        return False
    return last is None or (test.time, test.id) < (last.time, last.id)


def _dated(tests: Sequence[StoredTest]) -> list[DatedTest]:
    return [(each.test, each.time) for each in tests]
