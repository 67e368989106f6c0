"""`shm alerts ack`, `shm drift rebaseline`, `gap adopt`: what a person does, on record."""

from __future__ import annotations

import numpy as np
import pytest

from shm.pipeline import adopting, rebaselining
from shm.store import Store, StoredAlert, Workspace
from shm.store.watch import list_adoptions
from tests.cli.conftest import Shm
from tests.helpers import quick_update
from tests.helpers.flows import ingest
from tests.helpers.workspaces import write_test

LOSS = 2
"""The number of the alert; the first asks to repeat the test that showed the loss first."""
REBASELINE = "drift rebaseline --hanger 3 --why 'pin replaced' --since"
STIFFNESS = "beam1+bending_stiffness@everywhere"
ADOPT = "gap adopt --hanger 3 --effect bending_stiffness --at everywhere --why"


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put a stand-in in the sampler's place."""
    for module in (rebaselining, adopting):
        monkeypatch.setattr(
            module, "update", lambda t, m, o, *_, **__: quick_update.update(t, m, o)
        )
    monkeypatch.setattr("shm_cli.update.update", lambda t, m, o, _: quick_update.update(t, m, o))
    monkeypatch.setattr("shm_cli.update.select", lambda t, m, o, *_: quick_update.select(t, m, o))


@pytest.fixture
def on_copy(on_copy: Shm, copied: Workspace) -> Shm:
    """Return commands on a bridge with one open alert."""
    with copied.store() as store:
        notice, loss = sorted(store.alerts.list_all(), key=lambda each: each.id)
        assert (notice.alert.kinds, loss.id) == (("repeat the test",), LOSS)
        assert notice.resolution is not None, "the alert of the loss answers it"
    return on_copy


def loss_in(store: Store) -> StoredAlert:
    (found,) = (each for each in store.alerts.list_all() if each.id == LOSS)
    return found


def test_an_alert_is_acknowledged_with_who_and_why(on_copy: Shm, copied: Workspace) -> None:
    """The list of alerts and the report say who took note."""
    assert "open" in on_copy("alerts").out
    ended = on_copy.done("alerts ack 2 --why 'pin replaced' --who Jansen")
    assert ended.out == "Alert 2 of hanger 3 is acknowledged.\n"
    with copied.store() as store:
        noted = loss_in(store).acknowledgement
    assert noted is not None
    assert (noted.who, noted.why) == ("Jansen", "pin replaced")
    (listed,) = (row for row in on_copy.json("alerts")["alerts"] if row["id"] == LOSS)
    assert listed["acknowledged"]["who"] == "Jansen"
    shown = on_copy("alerts").out
    assert "Jansen" in shown
    assert "open" not in shown
    report = on_copy.json("report --hanger 3")
    words = report["acknowledged"]["hanger-3:two-tests-agree:tension-down:t2:baseline-1"]
    assert words.startswith("Jansen, ")
    assert words.endswith(": pin replaced")


def test_acknowledgement_as_a_document(on_copy: Shm) -> None:
    noted = on_copy.json("alerts ack 2 --why 'pin replaced' --who Jansen")
    (listed,) = (row for row in on_copy.json("alerts")["alerts"] if row["id"] == LOSS)
    assert listed["acknowledged"] == noted["acknowledged"]
    assert (noted["id"], noted["acknowledged"]["who"]) == (LOSS, "Jansen")


def test_a_hanger_is_compared_anew_from_a_day_on(on_copy: Shm, copied: Workspace) -> None:
    """After it the shift from the old baseline is shown no more."""
    told = on_copy.told(f"{REBASELINE} 2026-06-30")
    assert told.startswith("Hanger 3 is compared with its one test since 2026-06-30 from now on: 5")
    assert "Its tests still show what alert 2 reported (tension fell by 20" in told
    assert "still open" not in told, "resolved, and so open no more"
    with copied.store() as store:
        baseline = store.watch.baseline(3)
    assert baseline is not None
    assert baseline.posterior.tests == ("t2",)
    assert on_copy("drift").told == (
        "Hanger 3 has a new baseline (2026-06-30); no test has come in since it was set."
    )
    report = on_copy.json("report --hanger 3")
    assert report["drifts"] == []
    assert report["status"] == "check", "20 % below nominal, whatever the baseline"
    assert report["alerts"]


def test_the_new_baseline_as_a_document(on_copy: Shm) -> None:
    document = on_copy.json(f"{REBASELINE} 2026-05-31T09:00:00Z --who Jansen")
    known = [document[key] for key in ("hanger", "who", "why", "model", "tests", "since")]
    assert known == [3, "Jansen", "pin replaced", "beam1", ["t1", "t2"], "2026-05-31T09:00:00Z"]


def after_works(workspace: Workspace, tension: float) -> None:
    """Take in a test of the day after the loss was told."""
    write_test(workspace.spool / "t3.modes.json", workspace, day=61, tension=tension)
    ingest(workspace)


@pytest.mark.parametrize("kind", ["retensioned", "repaired"])
@pytest.mark.parametrize("is_tested", [False, True])
def test_works_unseen_by_tests(on_copy: Shm, copied: Workspace, kind: str, is_tested: bool) -> None:
    # The tests since that day still show the loss: it would become the normal state.
    if is_tested:
        after_works(copied, 0.8)
    since = "2026-07-01" if is_tested else "2026-06-30"
    ended = on_copy(f"{REBASELINE} {since} --kind {kind}")
    assert ended.code == 3, ended.err
    for said in (
        f"hanger 3 is not {kind} by its tests since {since}", "alert 2: tension fell by 20",
        '--kind "accepted as it is"',
    ):  # fmt: skip
        assert said in ended.said
    with copied.store() as store:
        stored = loss_in(store)
        baseline = store.watch.baseline(3)
    assert (stored.resolution, stored.acknowledgement) == (None, None)
    assert baseline is not None
    assert baseline.since is None, "the former baseline stays"


def test_a_loss_that_is_accepted_as_it_is_ends_on_record(on_copy: Shm, copied: Workspace) -> None:
    document = on_copy.json(f"{REBASELINE} 2026-06-30 --who Jansen --kind 'accepted as it is'")
    assert document["alerts_explained"] == [LOSS]
    (accepted,) = document["accepted"]
    assert accepted["alert"] == LOSS
    assert accepted["words"].startswith("tension fell by 20")
    with copied.store() as store:
        resolution = loss_in(store).resolution
    assert resolution is not None
    assert resolution.who == "Jansen"
    assert resolution.why == "new baseline: accepted as it is: pin replaced"


def test_an_event_ends_the_alerts_that_it_explains(on_copy: Shm, copied: Workspace) -> None:
    after_works(copied, 1.0)
    document = on_copy.json(f"{REBASELINE} 2026-07-01 --who Jansen --kind retensioned")
    assert (document["kind"], document["why"]) == ("retensioned", "retensioned: pin replaced")
    assert (document["alerts_explained"], document["alerts_open"]) == ([LOSS], [])
    with copied.store() as store:
        stored = loss_in(store)
    assert stored.resolution is not None
    assert stored.acknowledgement is not None
    assert stored.acknowledgement.why == "explained by: retensioned: pin replaced"


def test_drift_of_one_hanger_tells_how_it_goes_with_the_temperature(on_bridge: Shm) -> None:
    why = "the temperatures of the tests differ by 0.0 K only"
    tension = on_bridge.json("drift --hanger 3")["temperature_coefficients"][0]
    assert (tension["quantity"], tension["known"]) == ("tension", False)
    assert tension["why_not_known"] == why
    assert f"not known: {why}" in on_bridge("drift --hanger 3").told
    assert "temperature_coefficients" not in on_bridge.json("drift")


# ------------------------------------------------------------ an effect is adopted


def test_adopting_says_what_it_did_and_status_keeps_saying_it(on_copy: Shm) -> None:
    """Select lets the adopted class compete."""
    told = on_copy.told(f"{ADOPT} 'a strand, not a rod'")
    assert f"Hanger 3 has the model class {STIFFNESS} from now on." in told
    assert "beam1 with bending_stiffness (everywhere), adopted" in told
    assert "hanger 3: beam1 with bending_stiffness (everywhere)" in on_copy("status").out
    first, second = on_copy.json("status")["hangers"]
    assert (first["model"], second["model"]) == (STIFFNESS, None)
    assert STIFFNESS in first["competing"]
    assert first["gap"]["has_grown"] is False
    assert second["gap"] is None
    models = on_copy.json("select --hanger 3")["models"]
    assert [each["model"] for each in models] == ["beam1", STIFFNESS]


def test_the_record_names_who_and_why_and_outlives_the_dropping(on_copy: Shm) -> None:
    on_copy(f"{ADOPT} 'a strand' --who Jansen")
    (listed,) = on_copy.json("gap adopted")["adoptions"]
    assert (listed["who"], listed["why"], listed["model"]) == ("Jansen", "a strand", STIFFNESS)
    told = on_copy.told("gap drop --hanger 3 --why 'a rod after all'")
    assert "hanger 3 has the class beam1 again" in told
    assert on_copy("gap adopted").code == 4
    assert "Jansen" in on_copy("gap adopted --all").out
    (record,) = on_copy.json("gap adopted --all")["adoptions"]
    assert record["undone_why"] == "a rod after all"


def test_several_adoptions_have_numbers(on_copy: Shm, monkeypatch: pytest.MonkeyPatch) -> None:
    """The gap now stands beside the one that is watched; one is dropped by its number."""
    monkeypatch.setattr(adopting, "gap_percent", lambda found: 0.2 if "+" in found.model else 2.0)

    def watch(store: Store, hanger: int) -> adopting.GapWatch:
        return adopting.GapWatch(list_adoptions(store, hanger)[-1], 4.321, True)

    monkeypatch.setattr("shm_cli.adopt.gap_watch", watch)
    on_copy(f"{ADOPT} a")
    on_copy("gap adopt --hanger 3 --effect distributed_mass --why b")
    listed = on_copy.json("gap adopted")["adoptions"]
    assert [each["gap_now_percent"] for each in listed] == [None, 4.321]
    assert [each["gap_has_grown"] for each in listed] == [None, True]
    rows = on_copy("gap adopted").told
    for said in ("2.00, 0.20, none", "0.20, 0.20, 4.32", "gap before, with it, now (%)"):
        assert said in rows
    drop = "gap drop --hanger 3 --why no"
    ended = on_copy(drop)
    assert ended.code == 2
    assert "one of 1, 2" in ended.err
    assert on_copy(f"{drop} --number 7").code == 4
    left = "has the class beam1+distributed_mass@everywhere again"
    assert left in on_copy(f"{drop} --number 1").out
    assert "has the class beam1 again" in on_copy(drop).out


def test_adopted_class_is_known(shm: Shm, hanger_file: object, modes_file: object) -> None:
    of = f"--hanger-file {hanger_file}"
    zero = " ".join(f"--set={name}=0" for name in ("section", "density", "length", "modulus"))
    found = [
        [row["frequency_hz"] for row in shm.json(f"predict {words} {of}")["frequencies"]]
        for words in ("beam1", f"{STIFFNESS} {zero} --set=stiffness_change=0")
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6)
    document = shm.json(f"update {modes_file} {of} --model {STIFFNESS}")
    assert document["model"] == STIFFNESS
    assert "stiffness_change" in document["parameters"]
