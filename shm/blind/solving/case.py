"""One case solved: its tests, identified where they are recordings, and the diagnosis of them."""

from __future__ import annotations

import traceback
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from shm.blind.layout import CASE_FILE, CASE_SCHEMA, HANGER_FILE, MODES_FILE, read_document
from shm.bridge import load_hanger
from shm.errors import BadInput, ShmError
from shm.gap import GapOptions, diagnose
from shm.identify import identify
from shm.identify.options import campaign_options
from shm.modes_document import load_modes, modes_document
from shm.read import read_test
from shm.values import Answer, Hanger, ModalTest, Recording

UNEXPECTED = "unexpected "


@dataclass(frozen=True)
class Refused:
    """A test of which no mode can be trusted, and why."""

    test: str
    why: str


@dataclass(frozen=True)
class Identified:
    """The tests of a case's recordings, and those that could not be used."""

    tests: tuple[ModalTest, ...]
    refused: tuple[Refused, ...]

    def document(self) -> dict[str, Any]:
        """The modal-tests document, with what was refused."""
        return {**modes_document(self.tests), "refused": [asdict(each) for each in self.refused]}


@dataclass(frozen=True)
class Solved:
    """The answer to a case, and the tests identified for it where they were recordings."""

    answer: Answer
    identified: Identified | None = None


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
) -> tuple[tuple[ModalTest, ...], Identified | None]:
    modes = directory / MODES_FILE
    if modes.exists():
        return load_modes(modes), None
    if known is not None and known.exists():
        return load_modes(known), None
    identified = identify_tests(directory, hanger)
    return identified.tests, identified


def identify_tests(directory: Path, hanger: Hanger) -> Identified:
    """The modal tests of recordings: t1_1.npz and t1_2.npz are one test, and so on.

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
            refused.append(Refused(name, str(error)))
    if not tests:
        raise BadInput(
            "; ".join(f"{each.test}: {each.why}" for each in refused) or "there is no test.",
            file=directory,
        )
    return Identified(tuple(tests), tuple(refused))


def _identified(paths: Sequence[Path], name: str, hanger: Hanger) -> ModalTest:
    records = [record for path in paths for record in read_test(path)]
    recordings = [each for each in records if isinstance(each, Recording)]
    return identify(records, campaign_options(recordings), test_id=name, hanger=hanger).test


def _last_line(error: Exception) -> str:
    where = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({Path(where.filename).name}, line {where.lineno})"
