"""Steps on a Dask cluster: on one machine the same to the bit, whatever dies meanwhile."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from pathlib import Path

import pytest

from shm.errors import BadInput, ShmError
from shm.store import Stage, Workspace
from shm.store.recordings import count_stages
from shm_daemon import run
from shm_daemon.cluster import Cluster
from tests.helpers import clusters
from tests.helpers.canonical import canonical
from tests.helpers.workspaces import make_workspace, put, write_test

FILES = 1


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[clusters.Cluster]:
    with clusters.a_cluster(tmp_path_factory.mktemp("dask")) as cluster:
        yield cluster


@pytest.fixture
def pool(cluster: clusters.Cluster) -> Iterator[Cluster]:
    pool = Cluster(cluster.address)
    yield pool
    pool.shutdown()


def worked_through(folder: Path, scheduler: str) -> Workspace:
    """Return tests with the real sampler, and a file that is refused."""
    settings = {"scheduler": scheduler, "workers": 2}
    workspace = make_workspace(folder, settings=settings, hooks={"mail": ["true"]})
    for day in range(FILES):
        write_test(workspace.spool / f"t{day}.modes.json", workspace, day=30 * day, tension=0.9)
    put(workspace.spool / "bad.csv", "# hanger: 3\nnothing,1\n")
    run(workspace, once=True)
    return workspace


@pytest.mark.slow
def test_a_cluster_gives_what_the_processes_of_one_machine_give_to_the_bit(
    tmp_path: Path, cluster: clusters.Cluster
) -> None:
    there = worked_through(tmp_path / "there", cluster.address)
    here = worked_through(tmp_path / "here", "")
    with there.store() as first, here.store() as second:
        assert count_stages(first)[Stage.DONE] == FILES
        assert count_stages(first)[Stage.REFUSED] == 1
        assert canonical(first) == canonical(second)


def test_an_error_of_a_step_comes_back_as_it_was(pool: Cluster) -> None:
    with pytest.raises(BadInput, match="line 3: odd") as caught:
        pool.submit(_refuse).result(60)
    assert caught.value.remedy == "Mend it."


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer_is_waited_for() -> None:
    with pytest.raises(ShmError, match="cannot be reached") as caught:
        Cluster("tcp://127.0.0.1:9").submit(os.getpid)
    assert caught.value.retry_after_s is not None


def test_a_step_that_kills_every_worker_is_told_as_a_crash(tmp_path: Path) -> None:
    environment = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
    with clusters.a_cluster(tmp_path, workers=1, **environment) as cluster:
        pool = Cluster(cluster.address)
        with pytest.raises(BrokenExecutor):
            pool.submit(os._exit, 1).result(60)
        pool.shutdown()


def _refuse() -> None:
    raise BadInput("odd.", line=3, remedy="Mend it.")
