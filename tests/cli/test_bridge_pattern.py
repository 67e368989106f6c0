"""`shm drift bridge` on a small store."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from shm.errors import NothingThere, UsageError
from shm.store import IdentifiedTest, Lineage, Store, Workspace
from shm.values import Drift, Selection, WatchedTest
from shm_cli.drift import bridge
from shm_cli.report import command as report
from tests.helpers.nouns import NOW, a_change, a_file, a_posterior, a_test
from tests.helpers.workspaces import make_workspace

LINEAGE = Lineage("0" * 64, "1" * 64, "0.1.0")
HANGERS = tuple(range(1, 11))
SHIFTS = {5: 0.021, 6: -0.05, 7: 0.026}


def watch(store: Store, hanger: int, shift: float) -> None:
    """Return a baseline at 11.5 deg C and a test at 31.5 deg C of one hanger."""
    for day, temperature in ((0, 11.5), (1, 31.5)):
        recording = store.recordings.receive(a_file(10 * hanger + day), NOW).recording
        name = f"h{hanger}-{day}"
        test = a_test(name, day, hanger=hanger, temperature_c=temperature)
        store.tests.save(recording.id, [IdentifiedTest(test)], LINEAGE, NOW)
    first, later = store.tests.list_all(hanger)
    posterior = a_posterior(tests=(first.test.id,))
    store.posteriors.save_selection(hanger, [first], Selection((posterior,), (1.0,)), LINEAGE, NOW)
    store.posteriors.save(later, a_posterior(tests=(later.test.id,)), LINEAGE, NOW)
    drift = Drift(
        hanger, later.test.id, NOW, "tension", 700e3, 700e3 * (1 + shift), shift, 0.002, 0.05, 0.5
    )
    baseline = store.watch.baseline(hanger)
    assert baseline is not None
    watched = WatchedTest(later.test.id, NOW, 31.5, (drift,), a_change())
    store.watch.save(later, baseline, watched, None, [], NOW)


@pytest.fixture(scope="module")
def arch(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Ten hangers; the last has no test, hanger 6 sheds load."""
    workspace = make_workspace(tmp_path_factory.mktemp("arch") / "bridge", hangers=HANGERS)
    with workspace.store() as store:
        for hanger in HANGERS[:-1]:
            watch(store, hanger, SHIFTS.get(hanger, 0.0))
    return workspace


def call(workspace: Workspace, *arguments: str) -> Result:
    return CliRunner().invoke(bridge, arguments, obj=str(workspace.folder))


def test_the_document_names_the_hanger_that_shed_load(arch: Workspace) -> None:
    document = json.loads(call(arch, "--json").stdout)
    assert document["schema"] == "shm.bridge_pattern/1"
    assert document["explanations"][0]["name"] == "load redistribution"
    assert document["suspects"][0]["hangers"] == [6]
    assert [row["hanger"] for row in document["rows"]] == list(HANGERS[:-1])
    assert document["not_compared"][0]["hanger"] == 10
    assert document["rows"][0]["position_m"] is None
    assert document["sentence"].startswith("Load has moved from hanger 6 to its neighbours.")


def test_the_table_ends_in_a_sentence_for_the_owner(arch: Workspace) -> None:
    told = call(arch).stdout
    assert "not compared" in told
    assert "load redistribution" in told
    assert "3 further explanations" in told
    assert "Load has moved from hanger 6 to its neighbours. Hanger 6 lost 35." in told


def test_a_common_shift_is_stated(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "bridge", hangers=HANGERS)
    with workspace.store() as store:
        for hanger in HANGERS:
            watch(store, hanger, -0.012)
    told = call(workspace).stdout
    assert "All hangers shifted alike, by -1." in told
    assert "a temperature, a clock or a load" in told


@pytest.mark.parametrize(
    "arguments", [[], ["--bridge", "--hanger", "6"], ["--bridge", "--test", "t"]]
)
def test_a_report_is_of_one_hanger_or_of_the_bridge(arch: Workspace, arguments: list[str]) -> None:
    ended = CliRunner().invoke(report, arguments, obj=str(arch.folder))
    assert isinstance(ended.exception, UsageError)


def test_too_few_hangers_are_an_answer_that_is_not_there_yet(tmp_path: Path) -> None:
    ended = call(make_workspace(tmp_path / "bridge"))
    assert isinstance(ended.exception, NothingThere)
    assert "Test more hangers" in ended.exception.remedy
