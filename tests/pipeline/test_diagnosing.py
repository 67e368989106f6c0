"""Which of the stored tests of a hanger are diagnosed together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from shm.pipeline.bridge_reporting import hanger_summaries
from shm.pipeline.diagnosing import choose_tests, latest_diagnosis
from shm.store import Store
from shm.values import WatchedTest
from tests.helpers.diagnoses import a_diagnosis
from tests.helpers.nouns import NOW, a_change, a_posterior, a_watched_test, an_alert
from tests.helpers.outboxes import LINEAGE, entered, make_baseline
from tests.helpers.workspaces import make_workspace

DETECTED = {"evidence_years": 350.0, "probability": 0.98}
NOTHING = {"evidence_years": 0.1, "probability": 0.01}


@pytest.mark.parametrize(
    ("watched", "alerts", "since"),
    [
        ((NOTHING, NOTHING, NOTHING), "", "t0"),
        ((NOTHING, NOTHING, DETECTED), "", "t2"),
        ((NOTHING, DETECTED, NOTHING), "", "t0"),  # the latest test shows that it is gone
        ((NOTHING, NOTHING, NOTHING), "called", "t2"),  # an alert of it has not ended
        ((NOTHING, NOTHING, NOTHING), "two agree", "t2"),
        ((NOTHING, NOTHING, NOTHING), "another kind", "t0"),
    ],
)
def test_choose_tests_since_the_change_in_force(
    tmp_path: Path, watched: tuple[dict[str, object], ...], alerts: str, since: str
) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    hanger = workspace.bridge.hanger(3)
    make_baseline(workspace)
    with workspace.store() as store:
        _watch(store, watched, alerts)
        every = choose_tests(store, hanger, every=True)
        assert [each.id for each in every.tests] == ["t0", "t1", "t2", "t3"]
        chosen = choose_tests(store, hanger)
        names = [each.id for each in chosen.tests]
        assert names == [f"t{number}" for number in range(int(since[1]), 4)]
        assert bool(chosen.remark) == (since != "t0")
        assert [each.id for each in choose_tests(store, hanger, 1).tests] == ["t3"]
        for names in (("t0", "t1"), ("t0", "t3")):
            made = replace(a_diagnosis(), tests=names)
            store.posteriors.save_diagnosis(3, made, LINEAGE, NOW)
            found = latest_diagnosis(store, hanger)
            assert found is not None
            is_old = since == "t2" and names[-1] == "t1"
            assert ("Diagnose again" in "".join(found.remarks)) == is_old
            (now,) = hanger_summaries(workspace, store, NOW, [hanger])
            line = f"Gap diagnosis of {NOW:%Y-%m-%d}: "
            assert any(each.startswith(line) for each in now.message.reasons) != is_old


def _watch(store: Store, watched: tuple[dict[str, object], ...], alerts: str) -> None:
    """Watch `t1` to `t3` against `t0`; the change of each began by `t2`."""
    baseline, tests = store.watch.baseline(3), entered(store, (1, 2, 3))
    assert baseline is not None
    for test, values in zip(tests, watched, strict=True):
        name = test.test.id
        store.posteriors.save(test, a_posterior(tests=(name,)), LINEAGE, NOW)
        change = a_change(began_after=tests[0].time, began_by=tests[1].time, **values)
        found: WatchedTest = replace(a_watched_test(name), change=change, time=test.time)
        alert = None
        if alerts and test is tests[-1]:
            alert = replace(
                an_alert(f"hanger-3:{name}", name),
                time=test.time,
                change=change if alerts == "called" else None,
                kinds=("beyond threshold",) if alerts == "two agree" else ("gap",),
            )
        store.watch.save(test, baseline, found, alert, [], NOW)
