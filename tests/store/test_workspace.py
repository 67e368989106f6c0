"""A workspace: made, opened, locked; and the template that `shm init` writes."""

from __future__ import annotations

import multiprocessing
import re
import tomllib
from pathlib import Path

import pytest

from shm.bridge import load_bridge
from shm.errors import BadInput, StoreBusy, UsageError
from shm.pipeline import utc_now
from shm.resources import default_config
from shm.settings import TABLE, load_settings
from shm.store import Workspace
from shm.store.recordings import list_recordings


def test_a_new_workspace_has_everything_and_opens(tmp_path: Path) -> None:
    workspace = Workspace.initialise(tmp_path / "bridge")
    assert workspace == Workspace.open(tmp_path / "bridge")
    names = sorted(path.name for path in workspace.folder.iterdir())
    assert names == ["archive", "bridge.toml", "quarantine", "shm.db", "spool"]
    assert [hanger.id for hanger in workspace.bridge.hangers] == [3]
    with workspace.store() as store:
        assert list_recordings(store) == ()


def test_a_workspace_is_not_made_twice(tmp_path: Path) -> None:
    Workspace.initialise(tmp_path)
    (tmp_path / "bridge.toml").write_text("# mine\n")
    with pytest.raises(UsageError, match="workspace already"):
        Workspace.initialise(tmp_path)
    assert (tmp_path / "bridge.toml").read_text() == "# mine\n"


def test_a_wrong_description_makes_no_workspace(tmp_path: Path) -> None:
    config = tmp_path / "wrong.toml"
    config.write_text("[[hanger]]\nid = 1\n")
    with pytest.raises(BadInput, match="length_m is missing"):
        Workspace.initialise(tmp_path / "bridge", config)
    assert not (tmp_path / "bridge").exists()


def test_flags_outrank_the_file_and_outlast_reopening(tmp_path: Path) -> None:
    Workspace.initialise(tmp_path)
    with (tmp_path / "bridge.toml").open("a") as file:
        file.write("samples = 300\nseed = 5\n")
    workspace = Workspace.open(tmp_path, {"samples": 200})
    assert (workspace.settings.samples, workspace.settings.seed) == (200, 5)
    assert workspace.reopened() == workspace


def test_only_one_process_at_a_time_holds_a_workspace(tmp_path: Path) -> None:
    workspace = Workspace.initialise(tmp_path)
    with workspace.lock(), pytest.raises(StoreBusy, match="spool/"), workspace.lock():
        pytest.fail("locked twice")
    with workspace.lock():
        assert (tmp_path / "shm.lock").read_text().isdigit()


def _hold(folder: Path, locked: multiprocessing.synchronize.Event) -> None:
    with Workspace.open(folder).lock():
        locked.set()
        multiprocessing.Event().wait()


def test_a_killed_process_lets_go_of_its_workspace(tmp_path: Path) -> None:
    workspace = Workspace.initialise(tmp_path)
    context = multiprocessing.get_context("fork")
    locked = context.Event()
    process = context.Process(target=_hold, args=(tmp_path, locked))
    process.start()
    assert locked.wait(10)
    with pytest.raises(StoreBusy, match=str(process.pid)), workspace.lock():
        pytest.fail("locked twice")
    process.kill()
    process.join()
    with workspace.lock():
        assert process.exitcode == -9


def test_the_template_is_a_valid_description() -> None:
    bridge = load_bridge(default_config())
    assert load_settings(bridge.settings_table, environment={}) == load_settings(environment={})
    assert bridge.hooks == ()


def test_a_new_description_shows_every_setting_with_its_default(tmp_path: Path) -> None:
    text = Path(Workspace.initialise(tmp_path / "bridge").bridge.source).read_text()
    shown = re.findall(r"^# (\w+ = .*?)  +# ", text.partition("[settings]")[2], flags=re.MULTILINE)
    assert tomllib.loads("\n".join(shown)) == {row.name: row.default for row in TABLE}


def test_a_setting_that_cannot_hold_is_refused_and_nothing_is_changed(tmp_path: Path) -> None:
    workspace = Workspace.initialise(tmp_path / "bridge")
    with workspace.store() as store:
        with pytest.raises(BadInput, match="samples"):
            workspace.change_setting(store, "settings.samples", 1.0, utc_now(), "anna")
        assert store.settings.list_current() == {}
        workspace.change_setting(store, "settings.samples", 4000.0, utc_now(), "anna")
        assert list(store.settings.list_current()) == ["settings.samples"]
