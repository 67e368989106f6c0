"""Cuts the power at many moments of a recorded ingest and looks at what is left each time."""

from __future__ import annotations

import hashlib
import math
import random
import tempfile
import time
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import sqlalchemy as sa

from shm.store import Stage, Workspace
from shm.store.backups import check_archive, check_store
from shm.store.journal import is_step
from shm.store.recordings import list_recordings
from shm.store.tables import journal
from tests.helpers.contents import quiet
from tests.helpers.flows import ingest
from tests.helpers.power import Disk, Operation, recorded
from tests.helpers.workspaces import make_workspace

_WORK = "tests.helpers.power_work"


@dataclass(frozen=True)
class Recorded:
    """An ingest into a workspace: what the disk held before, and all that was done to it."""

    disk: Disk
    operations: Sequence[Operation]

    @property
    def moments(self) -> list[int]:
        """After how many operations the power may be cut: all but what was only said."""
        return [k + 1 for k, each in enumerate(self.operations) if each.kind != "K"]


def record(where: Path, files: int) -> Recorded:
    """Records what an ingest does to a new workspace."""
    drafts = where / "drafts"
    drafts.mkdir()
    workspace = make_workspace(where / "bridge", hooks={"mail": ["true"]})
    disk = Disk(workspace.folder)
    words = (str(files), str(drafts))
    return Recorded(disk, recorded(workspace.folder, _WORK, *words, where=where))


def cut_at(
    made: Recorded,
    moments: Collection[int],
    rng: random.Random,
    every: int,
    memory: str | None = None,
    until: float = math.inf,
) -> tuple[int, int]:
    """Cuts at each of some moments, and goes on after one in `every`; how many of both there were.

    Goes once through the recording, which is used up by it, and no longer than to `until`, on the
    clock that only goes on.
    """
    cuts, went_on, counted = 0, 0, Counter(moments)
    for number, each in enumerate(made.operations, start=1):
        made.disk.do(each)
        if time.monotonic() > until:
            break
        for _ in range(counted[number]):
            goes_on = rng.randrange(every) == 0
            went_on, cuts = went_on + goes_on, cuts + 1
            seed = rng.randrange(2**32)
            try:
                _look(made.disk, random.Random(seed), goes_on, memory)
            except Exception as error:
                error.add_note(f"the cut came after operation {number}, {each.kind}; seed {seed}")
                raise
    return cuts, went_on


def _look(disk: Disk, rng: random.Random, goes_on: bool, memory: str | None) -> None:
    """Lays out what the disk may hold and opens it with shm: nothing promised is lost, nothing is
    half written and, where asked for, the work goes on to its end."""
    with tempfile.TemporaryDirectory(dir=memory) as folder:
        target = Path(folder) / "bridge"
        target.mkdir()
        disk.lay_out(target, rng)
        workspace = Workspace.open(target)
        promised = [each.split() for each in disk.promises]
        landed = {word for kind, word in promised if kind == "landed"}
        entered = {word for kind, word in promised if kind == "entered"}
        reached = max((int(word) for kind, word in promised if kind == "steps"), default=0)
        with workspace.store() as store:
            assert check_store(store, quiet).troubles == ()
            archived = check_archive(store, workspace.archive, quiet)
            assert archived.troubles == ()
            known = {each.file.sha256 for each in list_recordings(store)}
            with store.reading() as connection:
                count = connection.scalar(
                    sa.select(sa.func.count()).select_from(journal).where(is_step)
                )
        assert entered <= known, "what was entered is lost"
        assert landed <= known | in_spool(workspace), "what had landed is lost"
        assert count >= reached, "a stage that was reached is lost"
        if goes_on:
            ingest(workspace)
            with workspace.store() as store:
                stages = {each.file.sha256: each.stage for each in list_recordings(store)}
                assert landed <= stages.keys()
                assert set(stages.values()) <= {Stage.DONE, Stage.REFUSED}
                assert check_store(store, quiet).troubles == ()
                assert check_archive(store, workspace.archive, quiet).troubles == ()


def in_spool(workspace: Workspace) -> set[str]:
    """What lies in the spool, by checksum, but for what is under way there."""
    files = (path for path in workspace.spool.iterdir() if path.is_file())
    return {hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
