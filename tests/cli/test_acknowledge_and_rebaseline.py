"""`shm alerts ack` and `shm drift rebaseline`: what a person does about the watch, on record."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from shm.pipeline import rebaselining
from shm.store import Store, StoredAlert, Workspace
from tests.cli.conftest import Shm
from tests.helpers import quick_update
from tests.helpers.flows import ingest
from tests.helpers.workspaces import write_test

LOSS = 2
"""The number of the alert; the first asks to repeat the test that showed the loss first."""
ACK = ("alerts", "ack", LOSS, "--why", "pin replaced")
ANEW = ("drift", "rebaseline", "--hanger", 3, "--why", "pin replaced")


@pytest.fixture
def workspace(bridge: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the bridge with a short history and one open alert, and a stand-in for the sampler."""
    monkeypatch.setattr(
        rebaselining,
        "update",
        lambda tests, model, options, *_, **__: quick_update.update(tests, model, options),
    )
    folder = tmp_path / "arch"
    shutil.copytree(bridge.folder, folder)
    with Workspace.open(folder, {}).store() as store:
        notice, loss = sorted(store.alerts.list_all(), key=lambda each: each.id)
        assert (notice.alert.kinds, loss.id) == (("repeat the test",), LOSS)
        store.alerts.resolve(notice.id, "Jansen", "repeated", loss.raised_at)
    return folder


def loss_in(store: Store) -> StoredAlert:
    (found,) = (each for each in store.alerts.list_all() if each.id == LOSS)
    return found


def test_an_alert_is_acknowledged_with_who_and_why(shm: Shm, workspace: Path) -> None:
    ended = shm("--workspace", workspace, *ACK, "--who", "Jansen")
    assert ended.code == 0, ended.err
    assert ended.out == "Alert 2 of hanger 3 is acknowledged.\n"
    with Workspace.open(workspace, {}).store() as store:
        noted = loss_in(store).acknowledgement
    assert noted is not None
    assert (noted.who, noted.why) == ("Jansen", "pin replaced")


def test_the_list_of_alerts_says_who_took_note(shm: Shm, workspace: Path) -> None:
    assert "open" in shm("--workspace", workspace, "alerts").out
    noted = shm("--workspace", workspace, *ACK, "--who", "Jansen", "--json").document
    rows = shm("--workspace", workspace, "alerts", "--json").document["alerts"]
    (listed,) = (row for row in rows if row["id"] == LOSS)
    assert listed["acknowledged"] == noted["acknowledged"]
    assert (noted["id"], noted["acknowledged"]["who"]) == (LOSS, "Jansen")
    shown = shm("--workspace", workspace, "alerts").out
    assert "Jansen" in shown
    assert "open" not in shown


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("alerts", "ack", 7, "--why", "x"), 4, "no alert 7. See `shm alerts`."),
        (("alerts", "ack", 1), 2, "--why"),
        (("alerts", "ack", "x", "--why", "x"), 2, "ID"),
        ((*ANEW, "--since", "2027-01-01"), 4, "no test since 2027-01-01"),
        ((*ANEW, "--since", "lately"), 2, "--since"),
        ((*ANEW,), 2, "--since"),
        ((*ANEW, "--since", "2026-06-30", "--kind", "painted"), 2, "--kind"),
        (("drift", "rebaseline", "--since", "2026-05-01", "--why", "x"), 2, "--hanger"),
        (("drift", "rebaseline", "--hanger", 4, "--since", "2026-05-01", "--why", "x"), 4,
         "no baseline yet"),
        (("drift", "rebaseline", "--hanger", 9, "--since", "2026-05-01", "--why", "x"), 4,
         "hanger 9"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_is_said_with_its_exit_code(
    shm: Shm, workspace: Path, arguments: tuple[object, ...], code: int, said: str
) -> None:
    ended = shm("--workspace", workspace, *arguments)
    assert ended.code == code, ended.err
    assert said in " ".join(ended.err.split())
    assert ended.out == ""


def test_a_hanger_is_compared_anew_from_a_day_on(shm: Shm, workspace: Path) -> None:
    ended = shm("--workspace", workspace, *ANEW, "--since", "2026-06-30")
    assert ended.code == 0, ended.err
    assert ended.out.startswith(
        "Hanger 3 is compared with its one test since 2026-06-30 from now on: 5"
    )
    with Workspace.open(workspace, {}).store() as store:
        baseline = store.watch.baseline(3)
    assert baseline is not None
    assert baseline.posterior.tests == ("t2",)


def test_the_new_baseline_as_a_document(shm: Shm, workspace: Path) -> None:
    ended = shm("drift", "rebaseline", "--workspace", workspace, *ANEW[2:], "--json",
                "--who", "Jansen", "--since", "2026-05-31T09:00:00Z")  # fmt: skip
    assert ended.code == 0, ended.err
    document = ended.document
    assert (document["hanger"], document["who"], document["why"], document["model"]) == (
        3, "Jansen", "pin replaced", "beam1",
    )  # fmt: skip
    assert document["tests"] == ["t1", "t2"]
    assert document["since"] == "2026-05-31T09:00:00Z"


def after_works(folder: Path, tension: float) -> None:
    """Return a test of the day after the loss was told."""
    opened = Workspace.open(folder, {})
    write_test(opened.spool / "t3.modes.json", opened, day=61, tension=tension)
    ingest(opened)


@pytest.mark.parametrize("kind", ["retensioned", "repaired"])
@pytest.mark.parametrize("is_tested", [False, True])
def test_works_that_no_test_shows_end_no_alert(
    shm: Shm, workspace: Path, kind: str, is_tested: bool
) -> None:
    # The tests since that day still show the loss: it would become the normal state.
    if is_tested:
        after_works(workspace, 0.8)
    since = "2026-07-01" if is_tested else "2026-06-30"
    ended = shm("--workspace", workspace, *ANEW, "--since", since, "--kind", kind)
    assert ended.code == 3, ended.err
    said = " ".join(ended.err.split())
    assert f"hanger 3 is not {kind} by its tests since {since}" in said
    assert "alert 2: tension fell by 20" in said
    assert '--kind "accepted as it is"' in said
    with Workspace.open(workspace, {}).store() as store:
        stored = loss_in(store)
        baseline = store.watch.baseline(3)
    assert (stored.resolution, stored.acknowledgement) == (None, None)
    assert baseline is not None
    assert baseline.since is None, "the former baseline stays"


def test_a_loss_that_is_accepted_as_it_is_ends_on_record(shm: Shm, workspace: Path) -> None:
    ended = shm("--workspace", workspace, *ANEW, "--since", "2026-06-30", "--who", "Jansen",
                "--kind", "accepted as it is", "--json")  # fmt: skip
    assert ended.code == 0, ended.err
    assert ended.document["alerts_explained"] == [LOSS]
    (accepted,) = ended.document["accepted"]
    assert accepted["alert"] == LOSS
    assert accepted["words"].startswith("tension fell by 20")
    with Workspace.open(workspace, {}).store() as store:
        resolution = loss_in(store).resolution
    assert resolution is not None
    assert (resolution.who, resolution.why) == (
        "Jansen", "new baseline: accepted as it is: pin replaced",
    )  # fmt: skip


def test_an_event_ends_the_alerts_that_it_explains(shm: Shm, workspace: Path) -> None:
    after_works(workspace, 1.0)
    ended = shm("--workspace", workspace, *ANEW, "--since", "2026-07-01", "--who", "Jansen",
                "--kind", "retensioned", "--json")  # fmt: skip
    assert ended.code == 0, ended.err
    document = ended.document
    assert (document["kind"], document["why"]) == ("retensioned", "retensioned: pin replaced")
    assert (document["alerts_explained"], document["alerts_open"]) == ([LOSS], [])
    with Workspace.open(workspace, {}).store() as store:
        stored = loss_in(store)
    assert stored.resolution is not None
    assert stored.acknowledgement is not None
    assert stored.acknowledgement.why == "explained by: retensioned: pin replaced"


def test_after_it_the_shift_from_the_old_baseline_is_shown_no_more(
    shm: Shm, workspace: Path
) -> None:
    told = shm("--workspace", workspace, *ANEW, "--since", "2026-06-30").out
    assert "Its tests still show what alert 2 told (tension fell by 20" in " ".join(told.split())
    assert "still open" not in told, "resolved, and so open no more"
    shown = shm("--workspace", workspace, "drift").out
    assert " ".join(shown.split()) == (
        "Hanger 3 is compared anew since 2026-06-30; no test has come in after that baseline was "
        "set."
    )
    report = shm("--workspace", workspace, "report", "--hanger", 3, "--json").document
    assert report["drifts"] == []
    assert report["status"] == "check", "20 % below nominal, whatever the baseline"
    assert report["alerts"]


def test_a_report_says_who_took_note_of_an_alert(shm: Shm, workspace: Path) -> None:
    shm("--workspace", workspace, *ACK, "--who", "Jansen")
    report = shm("--workspace", workspace, "report", "--hanger", 3, "--json").document
    noted = report["acknowledged"]["hanger-3:two-tests-agree:tension-down:t2:baseline-1"]
    assert noted.startswith("Jansen, ")
    assert noted.endswith(": pin replaced")


def test_of_one_hanger_drift_tells_how_it_goes_with_the_temperature(
    shm: Shm, workspace: Path
) -> None:
    document = shm("--workspace", workspace, "drift", "--hanger", 3, "--json").document
    tension = document["temperature_coefficients"][0]
    assert (tension["quantity"], tension["known"]) == ("tension", False)
    assert tension["why_not_known"] == "the temperatures of the tests differ by 0.0 K only"
    told = " ".join(shm("--workspace", workspace, "drift", "--hanger", 3).out.split())
    assert "not known: the temperatures of the tests differ by 0.0 K only" in told
    assert (
        "temperature_coefficients" not in shm("--workspace", workspace, "drift", "--json").document
    )
