"""A workspace seen from a notebook: what it keeps, and what is not there yet."""

from __future__ import annotations

from pathlib import Path

import pytest

import shm
from shm.errors import BadInput, NothingThere
from shm.store import Workspace
from tests.helpers.taken_in import with_a_loss


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 has three tests, the last two with a fifth less tension; hanger 4 has none."""
    return with_a_loss(tmp_path_factory.mktemp("api") / "bridge")


def test_it_gives_the_nouns_of_a_hanger(bridge: Workspace) -> None:
    with shm.Store(bridge.folder) as store:
        assert [hanger.id for hanger in store.hangers] == [3, 4]
        assert [test.id for test in store.tests(3)] == ["t0", "t1", "t2"]
        assert [each.tests for each in store.posteriors(3)] == [("t0",), ("t1",), ("t2",)]
        assert store.posterior(3).tests == ("t2",)
        assert store.posterior(3, "t0").tension_n.mean() == pytest.approx(711e3, rel=0.02)
        assert store.selection(3).selected.model == "beam1"


def test_what_is_not_there_yet_says_so(bridge: Workspace) -> None:
    with shm.Store(str(bridge.folder)) as store:
        assert store.tests(4) == ()
        for ask in (store.posterior, store.selection, store.diagnosis):
            with pytest.raises(NothingThere, match="hanger 4"):
                ask(4)
        with pytest.raises(NothingThere, match="no frequency response of test t0"):
            store.frequency_response(3, "t0")
        with pytest.raises(BadInput, match="hanger 9 is not described"):
            store.tests(9)


def test_a_folder_that_is_no_workspace_is_refused_and_stays_as_it_is(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"bridge.toml: no such file"):
        shm.Store(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_the_trend_is_drawn_from_what_is_kept(bridge: Workspace) -> None:
    with shm.Store(bridge.folder) as store:
        figure = shm.plot.trend(store.posteriors(3), store.tests(3), store.hanger(3))
    tests, repeats = figure.axes[0].containers
    assert len(tests.lines[0].get_xdata()) == len(repeats.lines[0].get_xdata()) == 3
