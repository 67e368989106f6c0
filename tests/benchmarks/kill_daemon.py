"""`kill -9` of the daemon at random moments of an ingest, on either kind of store: is every file
stored once, none lost, none half written, and does the store end as after an undisturbed run?

    python tests/benchmarks/kill_daemon.py --kills 200 --files 300 --store server

The lives are random times from the moment the daemon, or in most lives its first turn, begins; the
sampler is the tests' stand-in, so that the kills fall on all stages alike. `tests/faults` holds the
short form.
"""

from __future__ import annotations

import random
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import begin

from tests.helpers.killing import (
    assert_nothing_lost_doubled_or_half_written,
    killed_again_and_again,
    unfinished_uploads,
)
from tests.helpers.postgres import postgresql_server
from tests.helpers.workspaces import make_workspace


@contextmanager
def a_store(kind: str) -> Iterator[str]:
    """The setting `store`: empty for a file, else the URL of a store on a server of our own."""
    if kind == "file":
        yield ""
        return
    with postgresql_server() as databases, databases.store() as url:
        yield url


def main() -> None:
    options = begin.options(
        __doc__,
        kills=200,
        files=300,
        store=("file", "server"),
        longest=begin.Told(0.5, "longest life at work, in s"),
        seed=1,
    )
    began, rng = time.monotonic(), random.Random(options.seed)
    with tempfile.TemporaryDirectory() as folder, a_store(options.store) as url:
        undisturbed = unfinished_uploads(Path(folder) / "quiet", options.files)
        workspace = make_workspace(Path(folder) / "bridge", settings={"store": url})
        feed, seen = killed_again_and_again(
            workspace, options.kills, options.files, rng, options.longest
        )
        assert_nothing_lost_doubled_or_half_written(feed, undisturbed)
    print(
        f"store: {options.store}; {options.kills} kills, {options.files} files, the files stood in "
        f"{len(seen)} ways: 0 lost, 0 doubled, 0 half written, the end that of an undisturbed run; "
        f"{time.monotonic() - began:.0f} s"
    )


if __name__ == "__main__":
    main()
