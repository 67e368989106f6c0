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
from collections.abc import Mapping, Sequence
from concurrent.futures import as_completed
from pathlib import Path

from shm.bridge import load_hanger
from shm.errors import ShmError
from shm.gap import GapOptions, diagnose
from shm.modes_document import load_modes
from tests.benchmarks.blind.layout import (
    CASE_FILE,
    CASE_SCHEMA,
    HANGER_FILE,
    MODES_FILE,
    Round,
    Trial,
    answered,
    key_beside,
    read_document,
    seal_answers,
    verified_sha256,
    write_answer,
)
from tests.benchmarks.blind.truth import Answer
from tests.benchmarks.blind.workers import workers


def solved(directory: Path, left_out: Sequence[str] = ()) -> Answer:
    """Diagnose a case, with some effects left out of the catalogue.

    What goes wrong is an answer too.
    """
    case, without = directory.name, tuple(left_out)
    try:
        hanger = load_hanger(directory / HANGER_FILE)
        told = read_document(directory / CASE_FILE, CASE_SCHEMA)
        options = GapOptions(str(told["baseline"]), without, seed=int(told["seed"]))
        found = diagnose(load_modes(directory / MODES_FILE), hanger, options)
    except ShmError as error:
        return Answer(case, without, None, str(error))
    except Exception as error:  # noqa: BLE001 - one fault must not stop a trial of hours
        return Answer(case, without, None, f"unexpected {_last_line(error)}")
    return Answer(case, without, found)


def _last_line(error: Exception) -> str:
    where = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({Path(where.filename).name}, line {where.lineno})"


def solve_trial(trial: Trial) -> str:
    """Diagnose all cases that have no answer yet, and seal the answers: return their SHA-256.

    Each answer is written as it comes; where it stops, the next call goes on. Raises BadInput where
    answers were changed after they were sealed.
    """
    return _solve(trial, "answers", dict.fromkeys(trial.cases, ()))


def solve_left_out(trial: Trial, left_out: Mapping[str, Sequence[str]]) -> str:
    """Do the second round: the cases named, each without some effects in the catalogue.

    Raises NothingThere before the first round is sealed, BadInput where its answers were changed.
    """
    verified_sha256(trial, "answers")
    return _solve(trial, "left_out", left_out)


def _solve(trial: Trial, which: Round, wanted: Mapping[str, Sequence[str]]) -> str:
    """Let a guarded process solve the cases without an answer, then seal the round."""
    directory = trial.answers(which)
    if trial.seal(which).exists():
        verified_sha256(trial, which)
    directory.mkdir(exist_ok=True)
    earlier = answered(directory)
    readable, hidden = [trial.directory / "cases"], [key_beside(trial.directory)]
    missing = {case: effects for case, effects in wanted.items() if case not in earlier}
    if missing:
        with workers(1, guard, (readable, hidden)) as pool:
            running = [
                pool.submit(solved, trial.case_directory(case), effects)
                for case, effects in missing.items()
            ]
            for each in as_completed(running):
                write_answer(each.result(), directory)
    return seal_answers(trial, which)


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
    """Where the interpreter, its libraries and this repository lie."""
    package = Path(__file__).resolve().parents[3]
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
