"""Makes a blind trial: cases without a trace of their cause, and the key that is kept apart."""

from __future__ import annotations

import os
import secrets
import shutil
from collections import defaultdict
from collections.abc import Iterable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from shm.blind.layout import TRIAL_SCHEMA, Told, nobody
from shm.blind.making.case import WAYS, Draft, drafts, make_case
from shm.blind.sealing import write_key
from shm.blind.workers import workers
from shm.documents import dump
from shm.errors import UsageError
from shm.simulate import PLANTED, UNLISTED
from shm.values import TrueCase, Way

__all__ = ["WAYS", "MadeTrial", "make_trial"]

_SEED_BITS = 62  # nobody guesses it, and a JSON reader of 64 bits holds it
# Any instant does, if it is one for all.
_INSTANT = datetime(2026, 1, 1, tzinfo=UTC).timestamp()


@dataclass(frozen=True)
class MadeTrial:
    """What was made, and the SHA-256 of its key."""

    cases: tuple[TrueCase, ...]
    key_sha256: str


def make_trial(
    directory: Path,
    key: Path,
    cases: int,
    *,
    seed: int | None = None,
    ways: Sequence[Way] = WAYS,
    jobs: int = 1,
    told: Told = nobody,
) -> MadeTrial:
    """Makes a trial in a folder that is new or empty, and its key.

    The same seed gives the same cases, whatever the number of jobs; without one a seed is drawn
    that nobody can guess, and the key holds it. Nothing is left behind where it stops. Raises
    UsageError where folder or key are there already, or the key would lie in the folder.
    """
    _refuse_unless_free(directory, key)
    seed = secrets.randbits(_SEED_BITS) if seed is None else seed
    whole = directory.resolve()
    begun = whole.with_name(f".{whole.name}.part")
    shutil.rmtree(begun, ignore_errors=True)
    try:
        truths = _made(begun / "cases", cases, seed, ways, jobs, told)
        sha256 = write_key(key, truths, seed)
        document = {
            "schema": TRIAL_SCHEMA,
            "cases": [truth.case for truth in truths],
            "key_sha256": sha256,
        }
        (begun / "trial.json").write_text(dump(document) + "\n", encoding="utf-8")
        of_one_instant(begun)
        begun.replace(directory)
    finally:
        shutil.rmtree(begun, ignore_errors=True)
    return MadeTrial(truths, sha256)


def _made(
    directory: Path, cases: int, seed: int, ways: Sequence[Way], jobs: int, told: Told
) -> tuple[TrueCase, ...]:
    """The cases in their folders, each from a seed of its own."""
    mixing, *seeds = np.random.SeedSequence(seed).spawn(1 + cases)
    rng = np.random.default_rng(mixing)
    wanted = drafts(cases, ways, tuple(PLANTED), tuple(UNLISTED), rng)
    with workers(jobs) as pool:
        running = [
            pool.submit(make_case, directory / draft.case, draft, own)
            for draft, own in zip(wanted, seeds, strict=True)
        ]
        for done, each in enumerate(as_completed(running), 1):
            each.result()
            told(done, cases)
    _pad(directory, wanted)
    return tuple(each.result() for each in running)


def _pad(directory: Path, wanted: Sequence[Draft]) -> None:
    alike = defaultdict(list)
    for draft in wanted:
        alike[draft.richness, draft.way].append(directory / draft.case)
    for directories in alike.values():
        padded(directories)


def _refuse_unless_free(directory: Path, key: Path) -> None:
    if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
        raise UsageError(
            f"{directory} is there already and not empty.", remedy="Name a new folder."
        )
    if key.exists():
        raise UsageError(
            f"there is a key at {key} already.", remedy="Name another with --key, or move it away."
        )
    if directory.resolve() in key.resolve().parents:
        raise UsageError(f"the key {key} would lie in the trial's folder.", remedy="Keep it apart.")


def padded(directories: Iterable[Path]) -> None:
    """Brings the text files of the same name in these folders to one size.

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


def of_one_instant(directory: Path) -> None:
    """Gives a folder and all in it the same time."""
    for path in [*directory.rglob("*"), directory]:
        os.utime(path, (_INSTANT, _INSTANT))
