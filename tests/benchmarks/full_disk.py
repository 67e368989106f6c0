"""A disk that fills at every call of an ingest into a SQLite store: is anything lost?

    python tests/benchmarks/full_disk.py --files 8 --every 1

`tests/helpers/full_disks.py` does it; `tests/faults/test_full_disk.py` is the short form.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.helpers.full_disks import fill_at_calls


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=8)
    parser.add_argument("--every", type=int, default=1, help="at each so-many-th call")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None
    with tempfile.TemporaryDirectory(dir=memory) as folder:
        print(fill_at_calls(Path(folder), options.files, options.every, options.seed))


if __name__ == "__main__":
    main()
