"""The steps as functions of values: what is checked, what is noted, which seed."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from shm.errors import BadInput, ShmError
from shm.inference import UpdateOptions
from shm.models import build
from shm.pipeline import steps
from shm.pipeline.lineage import reason_document, seed_of
from shm.pipeline.steps import identify_file, watch_test
from shm.read import Limits
from shm.store import Baseline, IdentifiedTest, ReceivedFile, Stage, StoredRecording, Workspace
from shm.values import Alert, Hanger, ModalTest, Recording, WatchedTest
from tests.helpers import quick_update
from tests.helpers.nouns import NOW, a_check, a_foreign_mode, a_response, a_test
from tests.helpers.workspaces import START, modelled_test, put

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


def test_a_recording_is_identified_in_its_band_and_with_its_hanger(
    identify: Identify, logger: Logger
) -> None:
    (found,) = identify("h3.csv", band_low_hz=3.0, band_high_hz=50.0)
    options = logger.asked["options"]
    assert (options.band_low_hz, options.band_high_hz) == (3.0, 50.0)
    assert (logger.asked["hanger"], logger.asked["source"]) == (3, "h3.csv")
    assert found.test.id == "h3"
    assert found.frequency_response is not None
    assert found.notes == ("renumbered", "2 poles: too damped")
    assert (found.quality, found.set_aside) == ((a_check(),), (a_foreign_mode(),))


def test_settings_and_known_machines_reach_the_identifier(
    identify: Identify, logger: Logger, workspace: Workspace
) -> None:
    with Path(workspace.bridge.source).open("a", encoding="utf-8") as stream:
        stream.write('[[disturbance]]\nname = "pump"\nlow_hz = 24\nhigh_hz = 25\n')
    bridge = Workspace.open(workspace.folder).bridge
    options = steps.identify_options(replace(workspace.settings, mains_hz=60.0), bridge)
    assert options.disturbance_bands == (("pump", 24.0, 25.0),)
    assert (options.mains_hz, options.reference_force_n) == (60.0, 1000.0)


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


def test_a_wrong_time_keeps_no_modes_from_being_found(identify: Identify, logger: Logger) -> None:
    """It is for a person to say what to make of them: see `test_held`."""
    logger.time = NOW + timedelta(days=9000)
    (found,) = identify()
    assert found.test.time == logger.time


def test_a_recording_without_time_is_taken(identify: Identify, logger: Logger) -> None:
    logger.time = None
    (found,) = identify()
    assert found.test.time is None


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


def test_seeds_depend_on_what_is_computed_not_on_the_order() -> None:
    assert seed_of(1, ["a/0", "b/0"]) == seed_of(1, ["b/0", "a/0"])
    seeds = {seed_of(seed, [key]) for seed in (1, 2) for key in ("a/0", "a/1", "b/0")}
    assert len(seeds) == 6
    assert all(0 <= seed < 2**32 for seed in seeds)


def test_an_alert_belongs_to_its_baseline(workspace: Workspace) -> None:
    hanger = workspace.bridge.hanger(3)
    first, *later = (
        modelled_test(f"t{number}", hanger, 30 * number, 0.8 if number > 2 else 1.0)
        for number in range(5)
    )
    posteriors = [
        quick_update.update([test], build("beam1", hanger), UpdateOptions(samples=100, seed=1))
        for test in (first, *later)
    ]

    def watch(number: int, tests: Sequence[ModalTest]) -> tuple[WatchedTest, Alert | None]:
        baseline = Baseline(number, 3, posteriors[0], NOW, "shm", "first")
        dated = [(first, START)], [(test, test.time or NOW) for test in tests]
        said = watch_test(baseline, dated, posteriors[len(tests)], hanger, 100.0)
        assert said is not None
        return said[:2]

    keys = set()
    for number in (1, 2):
        found, alert = watch(number, later)
        assert alert is not None
        assert found.drifts[0].shift_mean == pytest.approx(-0.2, abs=0.02)
        keys.add(alert.key)
    assert len(keys) == 2
    assert watch(1, later[:2])[1] is None


def test_a_reason_names_file_line_channel_and_remedy() -> None:
    file = ReceivedFile("a" * 64, "logger/h3.csv", 1, "entry")
    recording = StoredRecording(1, file, NOW, Stage.RECEIVED)
    error = BadInput("NaN.", file="/x/h3.csv", channel="acc_2", line=7, remedy="Mend it.")
    assert reason_document(error, recording, NOW) == {
        "schema": "shm.reason/1",
        "file": "h3.csv",
        "line": 7,
        "channel": "acc_2",
        "message": "NaN.",
        "remedy": "Mend it.",
        "time": NOW,
        "sha256": "a" * 64,
    }
    assert reason_document(BadInput("x"), recording, NOW)["file"] == "logger/h3.csv"
    assert reason_document(ShmError("x", remedy="y"), recording, NOW)["remedy"] == "y"
    assert "internal error: KeyError" in reason_document(KeyError(1), recording, NOW)["message"]


def test_errors_come_back_whole_from_another_process() -> None:
    error = BadInput("NaN.", file="h3.csv", channel="acc_2", line=7, remedy="Mend it.")
    assert vars(pickle.loads(pickle.dumps(error))) == vars(error)
