"""A workspace seen from a notebook: what it keeps, and what is not there yet."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import shm
from shm.errors import BadInput, NothingThere
from shm.store import IdentifiedTest, Lineage, Workspace
from shm.store import Store as OpenStore
from shm.values import Selection
from shm_cli.main import run
from tests.helpers.nouns import NOW, a_file, a_posterior, a_test
from tests.helpers.taken_in import with_a_loss
from tests.helpers.workspaces import make_workspace


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 has three tests, the last two with a fifth less tension; hanger 4 has none."""
    return with_a_loss(tmp_path_factory.mktemp("api") / "bridge")


def test_store_gives_the_nouns_of_a_hanger_and_their_trend(bridge: Workspace) -> None:
    with shm.Store(bridge.folder) as store:
        assert [hanger.id for hanger in store.hangers] == [3, 4]
        assert [test.id for test in store.tests(3)] == ["t0", "t1", "t2"]
        assert [each.tests for each in store.posteriors(3)] == [("t0",), ("t1",), ("t2",)]
        assert store.posterior(3, model="beam1").tests == ("t2",)
        of_first = store.posterior(3, "t0", model="beam1")
        assert of_first.tension_n.mean() == pytest.approx(711e3, rel=0.02)
        assert store.selection(3).selected.model == "beam1"
    with shm.Store(bridge.folder) as store:
        figure = shm.plot.trend(store.posteriors(3), store.tests(3), store.hanger(3))
    (tests,) = figure.axes[0].containers
    assert len(tests.lines[0].get_xdata()) == 3


def test_tension_is_headline(bridge: Workspace, capsys: pytest.CaptureFixture[str]) -> None:
    """It is the tension of the report, and not that of one class."""
    run(["--workspace", str(bridge.folder), "report", "--hanger", "3", "--json"])
    stated = json.loads(capsys.readouterr().out)["averaged"]["tension_n"]
    with shm.Store(bridge.folder) as store:
        tensions = store.tensions(3)
        assert list(tensions) == ["t0", "t1", "t2"]
        assert store.tension(3, "t2") == tensions["t2"]
        assert store.tension(3, "t0") == tensions["t0"]
        headline = store.tension(3).tension_n
        assert (headline.mean, headline.q05, headline.q95) == pytest.approx(
            [stated[name] for name in ("mean", "q05", "q95")]
        )
        with pytest.raises(NothingThere, match="t9"):
            store.tension(3, "t9")
        with pytest.raises(NothingThere, match="hanger 4"):
            store.tension(4)


def test_tension_averages_classes(tmp_path: Path) -> None:
    """Its interval is that over all classes, which holds what one class leaves out."""
    workspace = make_workspace(tmp_path / "two", settings={"models": "beam1,beam2"})
    with workspace.store() as kept:
        store_two_classes(kept)
    with shm.Store(workspace.folder) as store:
        selection = store.selection(3)
        headline, one = store.tension(3).tension_n, store.posterior(3, model="beam2").tension_n
        assert headline == selection.averaged_with(store.hanger(3).limits).tension_n
        assert headline.q95 - headline.q05 > 1.2 * np.ptp(np.quantile(one, [0.05, 0.95]))
        other = store.posterior(3, model="beam1")
        assert (other.model, other.tests) == ("beam1", ("t1",))
        with pytest.raises(NothingThere, match=r"class beam3.*Its classes are beam1, beam2"):
            store.posterior(3, model="beam3")


def store_two_classes(kept: OpenStore) -> None:
    """Store a test whose two classes, equally probable, are a fifth of the tension apart."""
    lineage = Lineage("0" * 64, "1" * 64, "1.0.0")
    recording = kept.recordings.receive(a_file(1), NOW).recording
    kept.tests.save(recording.id, [IdentifiedTest(a_test("t1"))], lineage, NOW)
    beam2 = a_posterior("beam2", ("t1",))
    beam1 = replace(a_posterior("beam1", ("t1",)), nominal_tension_n=1.2 * beam2.nominal_tension_n)
    selection = Selection((beam2, beam1), (0.5, 0.5))
    kept.posteriors.save_selection(3, kept.tests.list_all(3), selection, lineage, NOW)


def test_posterior_without_class_warns(bridge: Workspace) -> None:
    with shm.Store(bridge.folder) as store:
        with pytest.warns(UserWarning, match=r"beam1 alone.* Use tension\(3\)"):
            assert store.posterior(3).tests == ("t2",)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            store.posterior(3, model="beam1")


def test_what_is_not_there_yet_says_so(bridge: Workspace) -> None:
    with shm.Store(str(bridge.folder)) as store:
        assert store.tests(4) == ()
        for ask in (store.posterior, store.tension, store.selection, store.diagnosis):
            with pytest.raises(NothingThere, match="hanger 4"):
                ask(4)
        with pytest.raises(NothingThere, match="no frequency response of test t0"):
            store.frequency_response(3, "t0")
        with pytest.raises(BadInput, match="hanger 9 is not described"):
            store.tests(9)


def test_a_folder_that_is_no_workspace_is_refused_and_stays_as_it_is(tmp_path: Path) -> None:
    for folder, lacks in ((tmp_path, "holds no bridge.toml"), (tmp_path / "none", "is no folder")):
        with pytest.raises(BadInput, match=rf"^{folder} {lacks}, .*shm\.Store\("):
            shm.Store(folder)
    assert list(tmp_path.iterdir()) == []
