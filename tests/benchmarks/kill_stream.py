"""kill -9 at 100 moments while chunks are appended and sealed: none lost, none counted twice.

python tests/benchmarks/kill_stream.py --kills 100 --seed 1
"""

from __future__ import annotations

import random
import sys
import tempfile
from pathlib import Path

import begin

from tests.helpers.stream_killing import assert_none_lost_none_doubled, killed_again_and_again


def main() -> int:
    """Run the trial and print its figures."""
    options = begin.options(__doc__, kills=100, seed=1)
    with tempfile.TemporaryDirectory() as folder:
        ring = Path(folder) / "ring"
        acknowledged = killed_again_and_again(ring, options.kills, random.Random(options.seed))
        assert_none_lost_none_doubled(ring, acknowledged)
    print(f"{options.kills} kills, {acknowledged} chunks acknowledged: none lost, none doubled")
    return 0


if __name__ == "__main__":
    sys.exit(main())
