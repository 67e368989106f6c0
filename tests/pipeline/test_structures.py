"""A structure that no model describes, from its description to alert, status and report."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from shm.errors import BadInput
from shm.pipeline import steps
from shm.store import Workspace
from shm_cli.main import run
from tests.helpers.flows import ingest
from tests.helpers.structures import DECK, HZ, LOST_FROM, with_a_deck, write_week
from tests.helpers.workspaces import make_workspace


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    settings = {"baseline_tests": 3}
    made = make_workspace(tmp_path / "bridge", hooks={"mail": ["true"]}, settings=settings)
    return with_a_deck(made)


def test_a_lost_stiffness_of_the_deck_is_told_and_shown(
    workspace: Workspace, capsys: pytest.CaptureFixture[str]
) -> None:
    for week in range(LOST_FROM + 4):
        write_week(workspace, week)
    ingest(workspace)

    with workspace.store() as store:
        assert len(store.watch.list_all(DECK)) == LOST_FROM + 4 - 3  # three are the baseline
        told = [each.alert for each in store.alerts.list_all(DECK) if each.alert.change]
        drifts = store.watch.list_drifts(DECK)[-len(HZ) :]
    assert told
    assert "of Deck ha" in told[0].message
    assert told[0].tension is None
    assert " " not in told[0].key
    assert {each.quantity for each in drifts} == {f"frequency {p} {o}" for p, o, _ in HZ}
    assert all(each.shift_mean == pytest.approx(-0.04, abs=0.006) for each in drifts)

    at = ["--workspace", str(workspace.folder)]
    assert run([*at, "status"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "structure 100 (Deck): 15 tests" in shown
    assert "have dropped by" in shown
    assert run([*at, "report", "--hanger", str(DECK), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["name"] == "Deck"
    assert [len(report["alerts"]), report["open_alerts"]] == [2, 1]  # the loss, not its notice
    assert report["baseline_hz"]["frequency transverse 1"] == pytest.approx(2.0, rel=1e-3)
    assert run([*at, "report", "--hanger", str(DECK)]) == 0
    assert "frequency transverse 2" in capsys.readouterr().out
    assert run([*at, "alerts", "--hanger", str(DECK)]) == 0
    assert "Deck" in capsys.readouterr().out


def test_the_watch_of_a_deck_goes_on_from_what_it_kept(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    watch, seen = steps.watch_test, []

    def noted(baseline: object, tests: tuple[list[object], list[object]], *terms: object) -> object:
        seen.append(len(tests[1]))
        return watch(baseline, tests, *terms)  # type: ignore[arg-type]

    monkeypatch.setattr(steps, "watch_test", noted)
    for week in range(7):
        write_week(workspace, week)
        ingest(workspace)

    assert seen == [1] * 4  # three made the baseline; each other one alone


def test_what_asks_for_a_tension_says_that_a_deck_has_none(workspace: Workspace) -> None:
    with pytest.raises(BadInput, match="has no tension"):
        workspace.bridge.hanger(DECK)
    assert workspace.bridge.tested(DECK).name == "Deck"
