"""Make a blind trial: cases without a trace of their cause, and the key that is kept apart."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from shm.documents import dump
from tests.benchmarks.blind.case import drafts, make_case
from tests.benchmarks.blind.layout import TRIAL_SCHEMA
from tests.benchmarks.blind.sealing import write_key
from tests.benchmarks.blind.truth import TrueCase
from tests.benchmarks.blind.workers import workers
from tests.worlds.simulated.effects.registry import PLANTED, UNLISTED

# Any instant does, if it is one for all.
_INSTANT = datetime(2026, 1, 1, tzinfo=UTC).timestamp()


def make_trial(directory: Path, cases: int, seed: int, jobs: int = 1) -> tuple[TrueCase, ...]:
    """Make the cases of the simulator's mix in a new folder, and return what was planted.

    The same seed gives the same cases, whatever the number of jobs.
    """
    mixing, *seeds = np.random.SeedSequence(seed).spawn(1 + cases)
    wanted = drafts(cases, tuple(PLANTED), tuple(UNLISTED), np.random.default_rng(mixing))
    with workers(jobs) as pool:
        running = [
            pool.submit(make_case, directory / "cases" / draft.case, draft, own)
            for draft, own in zip(wanted, seeds, strict=True)
        ]
        return tuple(each.result() for each in running)


def seal(directory: Path, key: Path, truths: Sequence[TrueCase], seed: int) -> str:
    """Write the key and the trial's document, and give all files one size and time.

    Return the SHA-256 of the key.
    """
    sha256 = write_key(key, truths, seed)
    cases = [truth.case for truth in truths]
    document = {"schema": TRIAL_SCHEMA, "cases": cases, "key_sha256": sha256}
    (directory / "trial.json").write_text(dump(document) + "\n", encoding="utf-8")
    pad(directory / "cases" / case for case in cases)
    give_one_time(directory)
    return sha256


def pad(directories: Iterable[Path]) -> None:
    """Bring the text files of the same name in these folders to one size.

    Spaces stand before the last end of line, where neither JSON nor TOML minds them.
    """
    by_name = defaultdict(list)
    for directory in directories:
        for path in directory.iterdir():
            if path.suffix in (".json", ".toml"):
                by_name[path.name].append(path)
    for paths in by_name.values():
        largest = max(path.stat().st_size for path in paths)
        for path in paths:
            content = path.read_bytes().removesuffix(b"\n")
            path.write_bytes(content.ljust(largest - 1) + b"\n")


def give_one_time(directory: Path) -> None:
    """Give a folder and all in it the same time."""
    for path in [*directory.rglob("*"), directory]:
        os.utime(path, (_INSTANT, _INSTANT))
