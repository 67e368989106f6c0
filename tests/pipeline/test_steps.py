"""The steps as functions of values: what is checked, what is noted, which seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from shm.errors import BadInput, ShmError
from shm.pipeline import steps
from shm.pipeline.faults import explain_refusal
from shm.pipeline.steps import identify_file
from shm.read import Limits
from shm.store import IdentifiedTest, ReceivedFile, Stage, StoredRecording, Workspace
from shm.values import Hanger, ModalTest, Recording
from tests.helpers.nouns import NOW, a_check, a_foreign_mode, a_response, a_test
from tests.helpers.workspaces import put

Identify = Callable[..., tuple[IdentifiedTest, ...]]


@pytest.fixture
def identify(workspace: Workspace) -> Identify:
    """Archives content as a file of that name and identifies it."""

    def run(name: str = "h3.csv", content: str = "x", **settings: object):  # type: ignore[no-untyped-def]
        put(workspace.spool / name, content)
        kept = workspace.archive.keep(workspace.spool / name)
        file = ReceivedFile(kept.sha256, name, kept.size_bytes, "entry", kept.archived_as)
        recording = StoredRecording(1, file, NOW, Stage.RECEIVED)
        terms = replace(workspace.settings, **settings)  # type: ignore[arg-type]
        return identify_file(recording, workspace.archive, workspace.bridge, terms, {})

    return run


class Logger:
    """What the reader makes of any file, and what the identifier was asked about it."""

    def __init__(self) -> None:
        self.hanger: int | None = 3
        self.time: datetime | None = NOW
        self.asked: dict[str, Any] = {}

    def read_test(self, path: Path, limits: Limits) -> tuple[Recording, ...]:
        return (Recording(path.name, (), 512.0, self.hanger, self.time),)

    def identify(self, records: Any, options: Any, *, test_id: str, hanger: Hanger) -> Any:
        self.asked = {"options": options, "hanger": hanger.id, "source": records[0].source}
        test: ModalTest = a_test(test_id, hanger=records[0].hanger, time=records[0].time)
        dropped = (SimpleNamespace(count=2, what="poles", reason="too damped"),)
        found = SimpleNamespace(
            test=test,
            frequency_response=a_response(),
            dropped=dropped,
            notes=("renumbered",),
            quality=(a_check(),),
            set_aside=(a_foreign_mode(),),
        )
        return SimpleNamespace(with_orders=lambda source: found)


@pytest.fixture
def logger(monkeypatch: pytest.MonkeyPatch) -> Logger:
    logger = Logger()
    monkeypatch.setattr(steps, "read_test", logger.read_test)
    monkeypatch.setattr(steps, "identify", logger.identify)
    return logger


def test_a_recording_without_hanger_is_refused_before_it_is_identified(
    identify: Identify, logger: Logger
) -> None:
    logger.hanger = None
    with pytest.raises(BadInput, match=r"names no hanger.*sidecar"):
        identify()
    assert logger.asked == {}


def test_a_recording_of_an_unknown_hanger_says_which_are_known(
    identify: Identify, logger: Logger
) -> None:
    logger.hanger = 99
    with pytest.raises(BadInput, match=r"hanger 99 .* \(known: 3\)"):
        identify()


@pytest.mark.parametrize(("content", "fault"), [("", "empty"), ("x" * 11, "11 bytes are more")])
def test_a_file_of_impossible_size_is_refused_unread(
    identify: Identify, logger: Logger, content: str, fault: str
) -> None:
    with pytest.raises(BadInput, match=fault):
        identify(content=content, max_file_bytes=10)
    assert logger.asked == {}


def test_two_tests_of_one_name_in_a_file_are_refused(identify: Identify) -> None:
    mode = '{"plane": "transverse", "order": 1, "frequency_hz": 5.8}'
    test = f'{{"id": "t1", "modes": [{mode}]}}'
    content = f'{{"schema": "shm.modes/1", "hanger": 3, "tests": [{test}, {test}]}}'
    with pytest.raises(BadInput, match="t1 is given 2 times"):
        identify("h3.modes.json", content)


def test_a_reason_names_file_line_channel_and_remedy() -> None:
    of_file = ("logger/h3.csv", "a" * 64, NOW)
    error = BadInput("NaN.", file="/x/h3.csv", channel="acc_2", line=7, remedy="Mend it.")
    assert explain_refusal(error, *of_file) == {
        "schema": "shm.reason/1",
        "file": "h3.csv",
        "line": 7,
        "channel": "acc_2",
        "message": "NaN.",
        "remedy": "Mend it.",
        "time": NOW,
        "sha256": "a" * 64,
    }
    assert explain_refusal(BadInput("x"), *of_file)["file"] == "logger/h3.csv"
    assert explain_refusal(ShmError("x", remedy="y"), *of_file)["remedy"] == "y"
    assert "internal error: KeyError" in explain_refusal(KeyError(1), *of_file)["message"]
