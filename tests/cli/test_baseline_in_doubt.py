"""A baseline in doubt is said by status, report and dashboard alike, and first."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from shm.documents import dump
from shm.modes_document import modes_document
from shm.pipeline.reporting import hanger_report
from shm.report.as_text import as_text
from shm.report.hanger_report import hanger_paper
from shm.store import Workspace
from shm.store.recordings import list_holds
from tests.cli.conftest import Shm
from tests.helpers.flows import ingest
from tests.helpers.workspaces import START, make_workspace, modelled_test, put

SAID = "Hanger 3: its baseline does not fit."


@pytest.fixture(scope="module")
def doubted(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 with two tests, most modes of the first of which are another thing."""
    workspace = make_workspace(tmp_path_factory.mktemp("doubted") / "bridge")
    hanger = workspace.bridge.hangers[0]
    wild = np.random.default_rng(3).uniform(0.75, 1.3, 12).tolist()
    first = modelled_test("t0", hanger)
    modes = tuple(
        replace(mode, frequency_hz=mode.frequency_hz * factor)
        for mode, factor in zip(first.modes, wild, strict=True)
    )
    tests = [replace(first, modes=modes), modelled_test("t1", hanger, day=30)]
    for test in tests:
        put(workspace.spool / f"{test.id}.modes.json", dump(modes_document([test])))
    ingest(workspace)
    with workspace.store() as store:
        for hold in list_holds(store):
            store.recordings.accept(hold.recording_id, "Ann", "as measured", START)
    ingest(workspace)
    return workspace


def test_status_says_it_in_words_and_as_a_document(shm: Shm, doubted: Workspace) -> None:
    told = shm("--workspace", doubted.folder, "status")
    assert SAID in " ".join(told.out.split())
    (row,) = json.loads(shm("--workspace", doubted.folder, "status", "--json").out)["hangers"]
    assert row["warnings"][0].startswith(SAID)
    assert row["left_out"] == []


def test_the_report_begins_with_it(doubted: Workspace) -> None:
    with doubted.store() as store:
        data = hanger_report(doubted, store, 3, START)
    text = " ".join(as_text(hanger_paper(data)).split())
    assert SAID in text
    undetermined = text.index("These modes do not determine the tension")
    assert text.index(SAID) < undetermined
    assert "No change" not in text[:undetermined]
