"""Flip random bits of a store and its archive: are raw files missed, does the daemon live?

    python tests/benchmarks/damage.py --minutes 10

A bridge with some tests is made once. For each flip of a store file its bit is flipped in a copy,
and the copy is read by an independent reader (Python's sqlite3, without shm): where it reads the
same rows of the same tables, the bit held no content (a free page, slack, a page's own
administration) and is counted apart, found or not. Every flip in the archive changes content and
must be found; of flips in rows it is counted how many are, since rows have no checksums (decision
record 0016).
Now and then the daemon runs on the damaged copy, with a new file in its spool.
"""

from __future__ import annotations

import random
import shutil
import sqlite3
import tempfile
import time
import traceback
from collections import Counter
from contextlib import closing
from pathlib import Path

import begin

import shm_daemon
from shm.errors import ShmError
from shm.store import Workspace
from shm.store.backups import check_archive, check_store
from shm_daemon.wakeup import Wakeup
from tests.helpers import quick_update
from tests.helpers.contents import quiet
from tests.helpers.flows import ingest, threads
from tests.helpers.workspaces import make_workspace, write_test


def made(folder: Path) -> Workspace:
    """Two hangers with four tests each, all through, in one file without a log beside it."""
    workspace = make_workspace(folder / "bridge", hangers=(3, 4))
    for hanger in (3, 4):
        for day in (0, 30, 60, 90):
            path = workspace.spool / f"h{hanger}-{day}.modes.json"
            write_test(path, workspace, hanger=hanger, day=day, tension=0.8 if day else 1.0)
    ingest(workspace)
    with closing(sqlite3.connect(workspace.database)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return workspace


def rows(database: Path) -> object:
    """All that a reader without shm finds: every value of every table; None where it finds none."""
    try:
        with closing(sqlite3.connect(database)) as connection:
            connection.text_factory = bytes
            query = "SELECT name, sql FROM sqlite_master WHERE type = 'table' ORDER BY name"
            tables = connection.execute(query).fetchall()
            return [
                (name, sql, connection.execute(f'SELECT * FROM "{name.decode()}"').fetchall())
                for name, sql in tables
            ]
    except (sqlite3.Error, UnicodeDecodeError):
        return None


def flip(path: Path, rng: random.Random) -> None:
    path.chmod(0o644)
    content = bytearray(path.read_bytes())
    content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    path.write_bytes(content)


def is_found(workspace: Workspace) -> bool:
    """Whether the check says that something is wrong."""
    try:
        with workspace.store() as store:
            archive = check_archive(store, workspace.archive, quiet)
            return bool(check_store(store, quiet).troubles or archive.troubles)
    except ShmError:
        return True


def lives(workspace: Workspace) -> bool:
    """Whether the daemon takes several turns without ending, a new file in its spool."""
    wakeup, turns = Wakeup(), 0
    write_test(workspace.spool / "new.modes.json", workspace, day=120, tension=0.8)
    waited = wakeup.wait

    def wait(seconds: float) -> object:
        nonlocal turns
        turns += 1
        if turns == 8:
            wakeup.stop()
        return waited(min(seconds, 0.05))

    wakeup.wait = wait  # type: ignore[method-assign, assignment]
    try:
        shm_daemon.run(workspace, wakeup=wakeup, make_executor=threads)
    except Exception as error:  # noqa: BLE001 - any end of the daemon is what is looked for
        print(f"the daemon ended: {error!r}", flush=True)
        return False
    return True


def main() -> None:
    options = begin.options(
        __doc__, minutes=10.0, every=begin.Told(10, "the daemon runs after one in so many"), seed=1
    )
    began, rng, counts = time.monotonic(), random.Random(options.seed), Counter[str]()
    quick_update.stand_in(setattr)
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None
    with tempfile.TemporaryDirectory(dir=memory) as folder:
        whole = made(Path(folder))
        before = rows(whole.database)
        assert not is_found(whole)
        while time.monotonic() - began < 60 * options.minutes:
            copy = Path(folder) / "copy"
            shutil.copytree(whole.folder, copy)
            workspace = Workspace.open(copy)
            in_archive = rng.random() < 0.2
            raw = sorted(workspace.archive.folder.glob("??/*"))
            flip(rng.choice(raw) if in_archive else workspace.database, rng)
            matters = in_archive or rows(workspace.database) != before
            try:
                found = is_found(workspace)
            except Exception:  # noqa: BLE001 - any end of the check is what is looked for
                traceback.print_exc()
                counts["check ended by an error"] += 1
                found = False
            kind = "archive" if in_archive else "rows" if matters else "no content"
            counts[f"{kind}: {'found' if found else 'not found'}"] += 1
            if in_archive and not found:
                shutil.copytree(copy, f"/tmp/missed-{options.seed}-{counts.total()}")
            if rng.randrange(options.every) == 0:
                counts["lived" if lives(workspace) else "died"] += 1
            shutil.rmtree(copy)
    flips = sum(n for name, n in counts.items() if ":" in name)
    print(f"{flips} flips: {dict(counts)}; {time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()
