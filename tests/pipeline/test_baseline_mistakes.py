"""Mistakes among the tests of a baseline: left out of it and of the watch, said everywhere."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from shm.documents import dump
from shm.inference import UpdateOptions
from shm.models import Model
from shm.modes_document import modes_document
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import hanger_summaries
from shm.pipeline.reporting import hanger_report
from shm.report.hanger_status import Status
from shm.store import Workspace
from shm.values import ModalTest
from tests.helpers import quick_update
from tests.helpers.flows import Clock, ingest
from tests.helpers.modelled_tests import misnamed
from tests.helpers.workspaces import START, make_workspace, modelled_test, put


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return make_workspace(tmp_path / "bridge", settings={"baseline_tests": 4})


def spool(workspace: Workspace, number: int, change: Any = None, tension: float = 1.0) -> ModalTest:
    hanger = workspace.bridge.hangers[0]
    test = modelled_test(f"t{number}", hanger, day=number, tension=tension)
    test = change(test) if change else test
    put(workspace.spool / f"t{number}.modes.json", dump(modes_document([test])))
    return test


@pytest.fixture
def updated_from(monkeypatch: pytest.MonkeyPatch) -> list[list[ModalTest]]:
    """The tests that each selection was made from."""
    from shm.pipeline import steps

    seen: list[list[ModalTest]] = []

    def select(tests: Sequence[ModalTest], models: Sequence[Model], options: UpdateOptions) -> Any:
        seen.append(list(tests))
        return quick_update.select(tests, models, options)

    monkeypatch.setattr(steps, "select", select)
    return seen


def test_a_mistaken_mode_enters_neither_the_posterior_nor_the_watch_and_the_origin_names_it(
    workspace: Workspace, updated_from: list[list[ModalTest]]
) -> None:
    wrong = partial(misnamed, plane="transverse", order=2)
    for number in range(4):
        spool(workspace, number, wrong if number == 2 else None)
    spool(workspace, 9)
    ingest(workspace)

    (tests,) = updated_from
    assert [len(test.modes) for test in tests] == [12, 12, 11, 12]
    with workspace.store() as store:
        baseline = store.watch.baseline(3)
        assert baseline is not None
        check = baseline.posterior.baseline_check
        assert check is not None
        assert [(each.test, each.plane, each.order) for each in check.modes] == [
            ("t2", "transverse", 2)
        ]
        report = hanger_report(workspace, store, 3, Clock().now)
        (line,) = hanger_summaries(workspace, store, utc_now())
    said = report.lineage["left_out_of_the_baseline"]
    (mode,) = check.modes
    assert said == (
        f"transverse 2 of test t2: measured {mode.measured_hz:.4g} Hz, expected "
        f"{mode.expected_hz:.4g} Hz"
    )
    assert mode.expected_hz < 0.8 * mode.measured_hz
    assert report.now.warnings == line.warnings == ()
    assert report.now.message == line.message
    assert "transverse 2" not in line.message.words


def test_a_mode_that_three_tests_have_wrong_is_one_notice_and_an_open_warning(
    workspace: Workspace,
) -> None:
    wrong = partial(misnamed, plane="transverse", order=3)
    for number in range(8):
        spool(workspace, number, wrong if number > 3 else None)
    ingest(workspace)
    with workspace.store() as store:
        alerts = [each.alert for each in store.alerts.list_all(3)]
        report = hanger_report(workspace, store, 3, Clock().now)
        (line,) = hanger_summaries(workspace, store, utc_now())
    (alert,) = [each for each in alerts if "check the modes" in each.kinds]
    assert alert.test == "t6"
    assert alert.message.startswith(
        f"Hanger 3: transverse 3 has not fitted the other modes since "
        f"{START + timedelta(days=4):%Y-%m-%d}. Check its number"
    )
    assert report.now.warnings == line.warnings
    assert report.now.warnings[0].startswith("Hanger 3: transverse 3 has not fitted")
    assert line.status is not Status.STEADY
