"""The disk fills at one call after the other while files come in, and is emptied again or not.

Run as a module under the recorder (`file_recorder.c`): `python -m tests.helpers.full_disks FOLDER
FILES EVERY SEED`. For each call it forks a daemon that meets a full disk there, looks at what is
left, lets a daemon with room go on, and looks again.
"""

from __future__ import annotations

import ctypes
import logging
import os
import random
import shutil
import sys
import threading
import time
import traceback
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace

from shm.errors import ShmError
from shm.store import Workspace
from shm.store.backups import check_archive, check_store
from shm.store.recordings import list_recordings
from shm_daemon import Wakeup, loop
from tests.helpers import quick_update
from tests.helpers.contents import quiet
from tests.helpers.feeds import Feed, assert_all_done_once
from tests.helpers.flows import Postman, threads
from tests.helpers.power import watched
from tests.helpers.power_cuts import in_spool
from tests.helpers.workspaces import START, make_workspace

_FASTER = 600.0
"""A minute of the daemon's waiting passes in a tenth of a second."""

_SHORTEST_S, _LONGEST_WAIT_S = 0.01, 0.05
"""What is shorter is not worth waiting for by the processor; what is longer hides the end."""

_FULL_S = 2.0
"""A disk that stays full is met for so long: twenty of the daemon's minutes."""
_LONGEST_S = 60.0
"""A daemon on a disk with room, in time, ends by itself long before."""
_FOR_EVER = 2**40
_ENDED, _TOLD, _UNTOLD = 0, 3, 4


@dataclass(frozen=True)
class Moment:
    """The disk is full from this call that takes room to before that one."""

    first: int
    last: int


def fill_at_calls(where: Path, files: int, every: int, seed: int = 1) -> str:
    """Fills the disk at each `every`-th call of an ingest of some files; what happened, in words.

    Raises CalledProcessError where anything was lost, half written or untold.
    """
    folder, said = where / "disk", where / "said"
    folder.mkdir()
    words = (str(files), str(every), str(seed), str(said))
    watched(folder, "tests.helpers.full_disks", *words, where=where, log=Path(os.devnull))
    return said.read_text()


def _daemon(workspace: Workspace, moment: Moment | None) -> int:
    """A daemon in this process until all is done or, on a disk that stays full, for a while."""
    recorder, wakeup, began = ctypes.CDLL(None), Wakeup(), time.monotonic()
    loop.time = SimpleNamespace(monotonic=lambda: began + _FASTER * (time.monotonic() - began))  # type: ignore[assignment]
    wait = wakeup.wait
    wakeup.wait = lambda seconds: wait(  # type: ignore[method-assign]
        min(max(seconds / _FASTER, _SHORTEST_S), _LONGEST_WAIT_S)
    )

    def clock() -> object:
        return START + timedelta(days=100, seconds=_FASTER * (time.monotonic() - began))

    if moment is not None:
        recorder.record_fill(ctypes.c_long(moment.first), ctypes.c_long(moment.last))
    threading.Thread(target=_end, args=(wakeup, moment), daemon=True).start()
    try:
        loop.run(
            workspace,
            wakeup=wakeup,
            once=True,
            make_executor=threads,
            notifier=Postman(),
            clock=clock,  # type: ignore[arg-type]
        )
    except ShmError:
        return _TOLD
    return _ENDED


def _end(wakeup: Wakeup, moment: Moment | None) -> None:
    """Ends a daemon that will not end by itself, a while after it met the full disk."""
    recorder, latest = ctypes.CDLL(None), time.monotonic() + _LONGEST_S
    full = _FOR_EVER if moment is None or moment.last < _FOR_EVER else moment.first
    while recorder.record_asked() < full and time.monotonic() < latest:
        time.sleep(0.05)
    time.sleep(_FULL_S)
    wakeup.stop()


def _in_a_process(workspace: Workspace, moment: Moment | None) -> int:
    child = os.fork()
    if child == 0:
        code = _UNTOLD
        try:
            code = _daemon(workspace, moment)
        except BaseException:
            traceback.print_exc()
            raise
        finally:
            sys.stderr.flush()
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _calls(workspace: Workspace) -> int:
    """How many calls of an ingest take room."""
    child = os.fork()
    if child == 0:
        ctypes.CDLL(None).record_fill(ctypes.c_long(0), ctypes.c_long(0))
        _daemon(workspace, None)
        report = workspace.folder.with_name("calls")
        asked = ctypes.CDLL(None).record_asked()
        report.write_text(str(asked))
        os._exit(0)
    os.waitpid(child, 0)
    return int(workspace.folder.with_name("calls").read_text())


def _look(feed: Feed) -> None:
    """Nothing is lost and nothing half written."""
    workspace = feed.workspace
    with workspace.store() as store:
        assert check_store(store, quiet).troubles == ()
        assert check_archive(store, workspace.archive, quiet).troubles == ()
        known = {each.file.file_name for each in list_recordings(store)}
    lying = in_spool(workspace)
    for name, checksum in feed.checksums.items():
        assert name in known or checksum in lying, f"{name} is lost"


def main() -> None:
    folder, files, every, seed = Path(sys.argv[1]), *map(int, sys.argv[2:5])
    logging.disable(logging.CRITICAL)
    quick_update.stand_in(setattr)
    drafts = folder / "drafts"
    drafts.mkdir()
    template = make_workspace(folder / "template", hooks={"mail": ["true"]})
    feed = Feed(template, drafts=drafts)
    for _ in range(files):
        feed.drop()
    rng = random.Random(seed)
    counted = shutil.copytree(template.folder, folder / "counted")
    calls = _calls(Workspace.open(counted))
    moments = range(1 + rng.randrange(every), calls + 1, every)
    codes: dict[int, int] = {}
    for first in moments:
        last = first + rng.choice((1, 3, 20, _FOR_EVER))
        here = Workspace.open(shutil.copytree(template.folder, folder / "bridge"))
        try:
            code = _in_a_process(here, Moment(first, last))
            codes[code] = codes.get(code, 0) + 1
            assert code in (_ENDED, _TOLD), f"it ended with {code}"
            mine = Feed(here, files=feed.files, bad=feed.bad)
            _look(mine)
            assert _in_a_process(here, None) == _ENDED
            _look(mine)
            assert_all_done_once(mine)
        except BaseException as error:
            error.add_note(f"the disk was full from call {first} to before call {last}")
            raise
        shutil.rmtree(here.folder)
    Path(sys.argv[5]).write_text(
        f"{calls} calls of an ingest of {files} files take room; the disk filled at "
        f"{len(moments)} of them: 0 lost, 0 half written; the daemon went on by itself in "
        f"{codes.get(_ENDED, 0)}, ended with an error that says so in {codes.get(_TOLD, 0)}"
    )


if __name__ == "__main__":
    main()
