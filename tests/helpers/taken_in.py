"""Workspaces that have taken files in: made once in a run, by whichever process comes first, and
copied, because a history is sampled for seconds and many files of tests look at the same ones.
"""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from shm.store import Workspace
from tests.helpers import quick_update
from tests.helpers.flows import ingest
from tests.helpers.workspaces import make_workspace, write_loss, write_slow_loss


def with_a_loss(folder: Path) -> Workspace:
    """Hanger 3 has three tests, the last two with a fifth less tension; hanger 4 has none."""
    return copied("loss", folder, lambda own: _taken_in(own, write_loss))


def with_a_slow_loss(folder: Path) -> Workspace:
    """Hanger 3 has lost a twelfth of its tension, as its last test shows; 4 has no tests."""
    return copied("slow loss", folder, lambda own: _taken_in(own, write_slow_loss))


def copied(name: str, folder: Path, make: Callable[[Path], object]) -> Workspace:
    """A copy, at `folder`, of the workspace that `make` makes at the folder it is given."""
    kept = Path(os.environ["SHM_CACHE"]).with_name("taken in") / name
    kept.parent.mkdir(exist_ok=True)
    with kept.with_name(f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not kept.exists():
            unfinished = kept.with_name(f"{name}.unfinished")
            shutil.rmtree(unfinished, ignore_errors=True)  # of a test that failed while making it
            make(unfinished)
            unfinished.rename(kept)
    return Workspace.open(Path(shutil.copytree(kept, folder)))


def ingest_quickly(workspace: Workspace) -> None:
    """Takes in all that lies in the spool, with the stand-in for the sampler."""
    with pytest.MonkeyPatch.context() as patch:
        quick_update.stand_in(patch.setattr)
        ingest(workspace)


def _taken_in(folder: Path, write: Callable[[Path, Workspace], None]) -> None:
    workspace = make_workspace(folder, hangers=(3, 4))
    write(workspace.spool, workspace)
    ingest(workspace)
