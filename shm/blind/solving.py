"""Solves a blind trial: every case in a process that can read nothing but its cases.

The key above all is guarded: an audit hook (Python's PEP 578), which cannot be removed again, sees
every file that Python opens, whatever its path: links are resolved first. It guards against any
slip of our own code, and against a cause that is looked up instead of found. It is no prison for
foreign machine code; who wants that as well keeps the key on another machine until the answers are
sealed.
"""

from __future__ import annotations

import os
import sys
import sysconfig
import traceback
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shm.blind.layout import (
    CASE_FILE,
    CASE_SCHEMA,
    HANGER_FILE,
    MODES_FILE,
    Round,
    Told,
    Trial,
    answered,
    key_beside,
    nobody,
    read_answers,
    read_document,
    seal_answers,
    verified_sha256,
    write_answer,
)
from shm.blind.workers import workers
from shm.bridge import load_hanger
from shm.documents import dump
from shm.errors import BadInput, ShmError
from shm.gap import GapOptions, diagnose
from shm.identify import identify
from shm.identify.options import campaign_options
from shm.modes_document import load_modes, modes_document
from shm.read import read_test
from shm.read.atomic import replace_text
from shm.values import Answer, Hanger, ModalTest, Recording

UNEXPECTED = "unexpected "


@dataclass(frozen=True)
class Solved:
    """The answer to a case, and the document of the tests identified where it has recordings."""

    answer: Answer
    identified: dict[str, Any] | None = None


def solved(directory: Path, left_out: Sequence[str] = (), known: Path | None = None) -> Solved:
    """Diagnoses a case, with some effects left out of the catalogue.

    `known` is the file of tests that were identified before. What goes wrong is an answer too.
    """
    case, without = directory.name, tuple(left_out)
    try:
        hanger = load_hanger(directory / HANGER_FILE)
        tests, identified = _tests(directory, hanger, known)
        found = diagnose(tests, hanger, _options(directory, without))
    except ShmError as error:
        return Solved(Answer(case, without, None, str(error)))
    except Exception as error:  # noqa: BLE001 - one fault must not stop a trial of hours
        return Solved(Answer(case, without, None, f"{UNEXPECTED}{_last_line(error)}"))
    return Solved(Answer(case, without, found), identified)


def _options(directory: Path, without: tuple[str, ...]) -> GapOptions:
    told = read_document(directory / CASE_FILE, CASE_SCHEMA)
    return GapOptions(str(told["baseline"]), without, seed=int(told["seed"]))


def _tests(
    directory: Path, hanger: Hanger, known: Path | None
) -> tuple[tuple[ModalTest, ...], dict[str, Any] | None]:
    modes = directory / MODES_FILE
    if modes.exists():
        return load_modes(modes), None
    if known is not None and known.exists():
        return load_modes(known), None
    return identify_tests(directory, hanger)


def identify_tests(directory: Path, hanger: Hanger) -> tuple[tuple[ModalTest, ...], dict[str, Any]]:
    """The modal tests of recordings, and their document, with what was refused.

    t1_1.npz and t1_2.npz are one test, and so on.

    Raises BadInput where no test has a mode that can be trusted.
    """
    files = defaultdict(list)
    for path in sorted(directory.glob("*.npz")):
        files[path.stem.partition("_")[0]].append(path)
    tests, refused = [], []
    for name, paths in files.items():
        try:
            tests.append(_identified(paths, name, hanger))
        except BadInput as error:
            refused.append({"test": name, "why": str(error)})
    if not tests:
        raise BadInput(
            "; ".join(f"{each['test']}: {each['why']}" for each in refused) or "there is no test.",
            file=directory,
        )
    return tuple(tests), {**modes_document(tests), "refused": refused}


def _identified(paths: Sequence[Path], name: str, hanger: Hanger) -> ModalTest:
    records = [record for path in paths for record in read_test(path)]
    recordings = [each for each in records if isinstance(each, Recording)]
    found = identify(records, campaign_options(recordings), test_id=name, hanger=hanger)
    return found.with_orders(name).test


def _last_line(error: Exception) -> str:
    where = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({Path(where.filename).name}, line {where.lineno})"


__all__ = ["SolvedRound", "solve_left_out", "solve_trial", "solved"]


@dataclass(frozen=True)
class SolvedRound:
    """The answers of a round and their SHA-256; `earlier` of them were there before."""

    answers: tuple[Answer, ...]
    sha256: str
    earlier: int

    @property
    def failed(self) -> tuple[Answer, ...]:
        """Those that hold no diagnosis."""
        return tuple(answer for answer in self.answers if answer.diagnosis is None)

    @property
    def unexpected(self) -> tuple[Answer, ...]:
        """Those that failed by a fault of shm."""
        return tuple(answer for answer in self.failed if answer.failure.startswith(UNEXPECTED))


def solve_trial(trial: Trial, *, jobs: int = 1, told: Told = nobody) -> SolvedRound:
    """Diagnoses all cases that have no answer yet, then seals the answers.

    Each answer is written as it comes; where it stops, the next call goes on. Raises BadInput where
    answers were changed after they were sealed.
    """
    return _solve(trial, "answers", dict.fromkeys(trial.cases, ()), jobs, told)


def solve_left_out(
    trial: Trial, left_out: Mapping[str, Sequence[str]], *, jobs: int = 1, told: Told = nobody
) -> SolvedRound:
    """The second round: the cases named, each without some effects in the catalogue.

    Raises NothingThere before the first round is sealed, BadInput where its answers were changed.
    """
    verified_sha256(trial, "answers")
    return _solve(trial, "left_out", left_out, jobs, told)


def _solve(
    trial: Trial, which: Round, wanted: Mapping[str, Sequence[str]], jobs: int, told: Told
) -> SolvedRound:
    directory = trial.answers(which)
    if trial.seal(which).exists():
        verified_sha256(trial, which)
    directory.mkdir(exist_ok=True)
    earlier = answered(directory)
    missing = {case: effects for case, effects in wanted.items() if case not in earlier}
    if missing:
        known = len(wanted) - len(missing)
        _solve_missing(trial, which, missing, jobs, lambda new: told(known + new, len(wanted)))
    sha256 = seal_answers(trial, which)
    return SolvedRound(read_answers(directory), sha256, len(wanted) - len(missing))


def _solve_missing(
    trial: Trial,
    which: Round,
    missing: Mapping[str, Sequence[str]],
    jobs: int,
    done: Callable[[int], None],
) -> None:
    """Lets guarded workers solve cases, and writes each answer as it comes."""
    readable = [trial.directory / "cases", trial.answers("answers")]
    hidden = [key_beside(trial.directory)]
    with workers(jobs, guard, (readable, hidden)) as pool:
        running = [
            pool.submit(solved, trial.case_directory(case), effects, trial.identified(case))
            for case, effects in missing.items()
        ]
        for count, each in enumerate(as_completed(running), 1):
            _write(each.result(), trial, which)
            done(count)


def _write(found: Solved, trial: Trial, which: Round) -> None:
    if found.identified is not None:
        replace_text(trial.identified(found.answer.case), dump(found.identified) + "\n")
    write_answer(found.answer, trial.answers(which))


_KEY_NAME = ".key.json"
_SYSTEM = ("/usr", "/lib", "/lib64", "/etc", "/proc", "/sys", "/dev", "/System", "/Library")
_TWO_PATHS = ("os.link", "os.symlink", "os.rename")
_ELSEWHERE = (
    "subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.fork",
    "os.forkpty", "os.startfile", "socket.connect", "socket.bind", "sqlite3.connect",
)  # fmt: skip


class Refused(PermissionError):
    """A guarded process asked for what a diagnosis does not need."""


def guard(readable: Sequence[Path], hidden: Sequence[Path]) -> None:
    """From now on this process opens files only in `readable` folders and where Python lies.

    Never the `hidden` ones, be it through a link of either kind. It starts no process and no
    connection either.
    """
    roots = tuple(os.path.realpath(root) for root in [*map(str, readable), *_python()])
    identities = {_identity(path) for path in hidden if path.exists()}

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        if event in _ELSEWHERE:
            raise Refused(f"a diagnosis of a blind trial does without {event}")
        paths = {"open": 1, **dict.fromkeys(_TWO_PATHS, 2)}.get(event, 0)
        for path in arguments[:paths]:
            if isinstance(path, str | bytes | os.PathLike):  # else it is open already
                _refuse_unless_free(os.fsdecode(path), roots, identities)

    sys.addaudithook(hook)


def _python() -> list[str]:
    """Where the interpreter, its libraries and this package lie."""
    package = Path(__file__).resolve().parents[2]
    return [
        sys.prefix, sys.base_prefix, sys.exec_prefix, *sysconfig.get_paths().values(),
        str(package), *_SYSTEM,
    ]  # fmt: skip


def _identity(path: str | Path) -> tuple[int, int]:
    """Device and inode: the same for every name of a file."""
    found = Path(path).stat()
    return found.st_dev, found.st_ino


def _refuse_unless_free(path: str, roots: Sequence[str], hidden: set[tuple[int, int]]) -> None:
    real = os.path.realpath(path)
    within = any(real == root or real.startswith(root + os.sep) for root in roots)
    linked = bool(hidden) and Path(real).exists() and _identity(real) in hidden
    if not within or linked or real.endswith(_KEY_NAME):
        raise Refused(f"a diagnosis of a blind trial may not open {path}")
