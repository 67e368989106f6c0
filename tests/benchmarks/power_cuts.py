"""Power cuts at every write of an ingest into a SQLite store: is anything lost or half written?

    python tests/benchmarks/power_cuts.py --files 12 --minutes 10

The ingest is recorded once, call by call; the disk is then laid out as a cut after each call may
leave it (`tests/helpers/power.py`), opened, checked with every checksum, and now and then the work
goes on to its end. `tests/faults/test_power_cuts.py` holds the short form, and
`tests/store/test_server_crashes.py` what is done to a PostgreSQL server.
"""

from __future__ import annotations

import random
import tempfile
import time
from collections import Counter
from pathlib import Path

import begin

from tests.helpers.power_cuts import cut_at, record


def main() -> None:
    options = begin.options(
        __doc__, files=12, minutes=10.0, cuts=begin.Told(400, "cuts a round"), seed=1
    )
    began, rng, rounds = time.monotonic(), random.Random(options.seed), 0
    total: Counter[str] = Counter()
    until = began + 60 * options.minutes
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None
    with tempfile.TemporaryDirectory() as folder:
        while time.monotonic() < until:
            rounds += 1
            where = Path(folder) / str(rounds)
            where.mkdir()
            made = record(where, options.files)
            kinds = Counter(each.kind for each in made.operations)
            moments = rng.sample(made.moments, min(options.cuts, len(made.moments)))
            cuts, went_on = cut_at(made, moments, rng, every=25, memory=memory, until=until)
            total.update(cuts=cuts, went_on=went_on, calls=len(made.moments))
            print(f"{total['cuts']} cuts in {time.monotonic() - began:.0f} s", flush=True)
    print(
        f"store: file; {options.files} files a round, {sum(kinds.values())} calls {dict(kinds)}; "
        f"{total['cuts']} cuts in {rounds} rounds, the work went on after {total['went_on']}: "
        f"0 lost, 0 half written; {time.monotonic() - began:.0f} s"
    )


if __name__ == "__main__":
    main()
