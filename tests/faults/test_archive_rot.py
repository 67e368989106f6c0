"""A raw file that rots in the archive is not used, and heals when the good one is dropped again."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.store import Outcome, Stage
from shm_cli import working
from shm_cli.main import run
from tests.helpers import quick_update
from tests.helpers.flows import a_flow, ingest, threads
from tests.helpers.workspaces import make_workspace, write_test


def test_rot_is_refused_and_the_same_file_dropped_again_heals_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    quick_update.stand_in(monkeypatch.setattr)
    monkeypatch.setattr(working, "executor_of", threads)
    workspace = make_workspace(tmp_path / "bridge")
    write_test(workspace.spool / "t0.modes.json", workspace)
    good = (workspace.spool / "t0.modes.json").read_bytes()
    ingest(workspace)
    (raw,) = workspace.archive.folder.glob("??/*")
    raw.chmod(0o644)
    raw.write_bytes(good.replace(b"11.5", b"99.5"))
    call = ["--workspace", str(workspace.folder)]
    assert run([*call, "db", "check", "--archive"]) == 5
    assert run([*call, "ingest", "--again", "t0"]) == 5
    assert f"archive/{raw.parent.name}/{raw.name}" in capsys.readouterr().err.replace("\n", "")
    with workspace.store() as store:  # nothing was superseded for want of the raw file
        assert store.tests.named(3, "t0").stage is Stage.WATCHED
    (workspace.spool / "t0.modes.json").write_bytes(good)
    with a_flow(workspace) as flow:
        receipt = flow.receive(workspace.spool / "t0.modes.json")
    assert receipt.outcome is Outcome.DUPLICATE
    assert raw.read_bytes() == good
    assert run([*call, "db", "check", "--archive"]) == 0
    assert run([*call, "ingest", "--again", "t0"]) == 0
