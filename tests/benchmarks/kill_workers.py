"""`kill -9` of workers in the midst of their steps: is any healthy file refused for it?

    python tests/benchmarks/kill_workers.py --kills 1000 --files 200 --workers 2

The daemon, its processes and its pauses are the real ones; the sampler is the tests' stand-in, and
each step is slowed down so that the kills strike it. `tests/faults` holds the short form.
"""

from __future__ import annotations

import logging
import random
import tempfile
import time
from collections import Counter
from pathlib import Path

import begin

from shm.store.journal import list_events
from tests.helpers.worker_killing import kill_workers, stage_counts
from tests.helpers.workspaces import make_workspace


def main() -> None:
    options = begin.options(
        __doc__,
        kills=1000,
        files=200,
        workers=2,
        seed=1,
        longest=begin.Told(14_400.0, "in s, before it gives up"),
    )
    logging.basicConfig(level=logging.ERROR)
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        settings = {"workers": options.workers}
        workspace = make_workspace(Path(folder) / "bridge", settings=settings)
        rng = random.Random(options.seed)
        struck = kill_workers(workspace, options.files, options.kills, rng, options.longest)
        counts = stage_counts(workspace)
        with workspace.store() as store:
            noted = Counter(event.kind for event in list_events(store))
    print(
        f"{struck} kills over {options.files} healthy files, {options.workers} workers: "
        f"{ {str(stage): n for stage, n in counts.items()} }; noted: {dict(noted)}; "
        f"{time.monotonic() - began:.0f} s"
    )


if __name__ == "__main__":
    main()
