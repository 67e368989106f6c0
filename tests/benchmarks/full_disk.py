"""A disk that fills at every call of an ingest into a SQLite store: is anything lost?

    python tests/benchmarks/full_disk.py --files 8 --every 1

`tests/helpers/full_disks.py` does it; `tests/faults/test_full_disk.py` is the short form.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import begin

from tests.helpers.full_disks import fill_at_calls


def main() -> None:
    options = begin.options(
        __doc__, files=8, every=begin.Told(1, "at each so-many-th call"), seed=1
    )
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None
    with tempfile.TemporaryDirectory(dir=memory) as folder:
        print(fill_at_calls(Path(folder), options.files, options.every, options.seed))


if __name__ == "__main__":
    main()
