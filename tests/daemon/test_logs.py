"""What the daemon tells: text or JSON, for people, files and the journal; never a secret."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from pathlib import Path

import pytest

from shm.settings import Settings
from shm.store import Workspace
from shm_daemon import run
from shm_daemon.logs import begin_logging, formatter
from tests.helpers import quick_update
from tests.helpers.flows import threads
from tests.helpers.workspaces import make_workspace, put, write_slow_loss


@pytest.fixture(autouse=True)
def _as_it_was() -> Iterator[None]:
    """Leaves the logging of this process as it was."""
    names = ("", "shm", "shm_daemon", "shm_cli")
    levels = {name: logging.getLogger(name).level for name in names}
    handlers = logging.getLogger().handlers[:]
    logging.getLogger().handlers = []  # else they would be closed
    yield
    for handler in logging.getLogger().handlers:
        handler.close()
    logging.getLogger().handlers = handlers
    for name, level in levels.items():
        logging.getLogger(name).setLevel(level)


def a_record(message: str, level: int = logging.INFO, **extra: object) -> logging.LogRecord:
    made = logging.getLogger("shm").makeRecord(
        "shm.pipeline.flow", level, "flow.py", 1, message, (), None, extra=extra
    )
    made.created = 1_780_000_000.25
    return made


def test_json_is_one_object_a_line_with_the_fields_that_are_known() -> None:
    line = formatter("json").format(a_record("update 7: done\nx", hanger=3, test="t7", odd=1))
    assert "\n" not in line
    assert json.loads(line) == {
        "time": "2026-05-28T20:26:40.250Z",
        "level": "info",
        "logger": "shm.pipeline.flow",
        "message": "update 7: done\nx",
        "hanger": 3,
        "test": "t7",
    }


def test_a_file_name_cannot_write_lines_of_its_own() -> None:
    line = formatter("text").format(a_record("a\n2026-01-01 ERROR forged\x1b[2J.csv: new"))
    assert "\n" not in line
    assert "\x1b" not in line
    assert "a\\n2026-01-01 ERROR forged\\x1b[2J.csv: new" in line


def test_a_log_file_is_put_aside_as_it_grows_and_old_ones_go(tmp_path: Path) -> None:
    begin_logging(Settings(log_file_bytes=10_000, log_files=2), tmp_path / "shm.log")
    for number in range(1000):
        logging.getLogger("shm").info("line %d of many lines that say little", number)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["shm.log", "shm.log.1", "shm.log.2"]
    assert all(path.stat().st_size <= 10_000 for path in tmp_path.iterdir())
    assert "line 999 " in (tmp_path / "shm.log").read_text()


def test_libraries_do_not_tell_addresses_even_at_debug(tmp_path: Path) -> None:
    """urllib3 writes the path of each request at DEBUG, which may be the key of a webhook."""
    begin_logging(Settings(log_level="debug"), tmp_path / "shm.log")
    logging.getLogger("urllib3.connectionpool").debug('"POST /services/T0P-SECRET HTTP/1.1"')
    logging.getLogger("shm").debug("ours")
    text = (tmp_path / "shm.log").read_text()
    assert "ours" in text
    assert "T0P-SECRET" not in text


def test_a_run_can_be_followed_by_recording_hanger_test_stage_and_hook(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    quick_update.stand_in(monkeypatch.setattr)
    workspace = _with_a_hook(tmp_path)
    begin_logging(Settings(log_format="json"), tmp_path / "shm.log")
    write_slow_loss(workspace.spool, workspace)
    put(workspace.spool / "bad.csv", "no recording")
    run(workspace, once=True, make_executor=threads)
    told = [json.loads(line) for line in (tmp_path / "shm.log").read_text().splitlines()]
    assert {"recording", "file", "stage"} <= set(_first(told, "t0.modes.json: new"))
    updated = _first(told, "update 2: done")
    assert (updated["hanger"], updated["test"], updated["stage"]) == (3, "t1", "update")
    refused = _first(told, "bad.csv is refused")
    assert (refused["file"], refused["stage"]) == ("bad.csv", "identify")
    alert = _first(told, "alert ")
    assert (alert["hanger"], alert["test"], alert["level"]) == (3, "t6", "warning")
    assert _first(told, "deliver 1: done")["hook"] == "siren"


def _with_a_hook(tmp_path: Path) -> Workspace:
    return make_workspace(tmp_path / "bridge", hooks={"siren": ["/bin/cat"]})


def _first(told: list[dict[str, object]], beginning: str) -> dict[str, object]:
    return next(entry for entry in told if str(entry["message"]).startswith(beginning))
