"""kill -9 at 100 moments while chunks are appended and sealed: none lost, none counted twice.

python tests/benchmarks/kill_stream.py --kills 100 --seed 1
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.helpers.stream_killing import assert_none_lost_none_doubled, killed_again_and_again


def main() -> int:
    """Run the trial and print its figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        ring = Path(folder) / "ring"
        acknowledged = killed_again_and_again(ring, options.kills, random.Random(options.seed))
        assert_none_lost_none_doubled(ring, acknowledged)
    print(f"{options.kills} kills, {acknowledged} chunks acknowledged: none lost, none doubled")
    return 0


if __name__ == "__main__":
    sys.exit(main())
