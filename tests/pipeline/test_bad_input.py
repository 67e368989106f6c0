"""What cannot be used goes to the quarantine with its reason; the good file behind it is done."""

from __future__ import annotations

import json
import re
import struct
from typing import Any

import pytest

from shm.store import Stage, Workspace
from shm.store.journal import list_events
from shm.store.recordings import count_stages, list_recordings
from shm.store.watch import list_selected_models
from tests.helpers.flows import ingest
from tests.helpers.workspaces import make_workspace, put, write_test

HEADER = {
    "hanger": "3",
    "time": "2026-05-01T10:00:00Z",
    "sampling_rate_hz": "512",
    "plane": ", transverse, longitudinal",
    "unit": "N, m/s2, m/s2",
    "x_m": "1.92, 2.52, 2.52",
}
ROWS = [f"{i % 7},{i % 5},{i % 3}" for i in range(2000)]
PICTURE = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + b"IHDR" + bytes(range(256)) * 4


def csv(rows: list[str] = ROWS, **header: str | None) -> str:
    values = {key: value for key, value in {**HEADER, **header}.items() if value is not None}
    lines = [f"# {key}: {value}" for key, value in values.items()]
    return "\n".join([*lines, "force,acc_1,acc_2", *rows]) + "\n"


BAD: dict[str, tuple[str | bytes, dict[str, Any]]] = {
    "empty.csv": ("", {"message": "empty"}),
    "picture.csv": (PICTURE, {"message": ""}),
    "nan_column.csv": (csv([f"{i % 7},nan,{i % 3}" for i in range(2000)]), {"channel": "acc_1"}),
    "wrong_unit.csv": (csv(unit="N, furlong, m/s2"), {"channel": "acc_1", "message": "furlong"}),
    "unknown_hanger.csv": (csv(hanger="99"), {"message": "hanger 99"}),
    "no_hanger.csv": (csv(hanger=None), {"message": "hanger"}),
    "no_rate.csv": (csv(sampling_rate_hz=None), {"message": "sampling rate|sampling_rate"}),
    "two_samples.csv": (csv(ROWS[:2]), {"message": "2"}),
    "garbled_number.csv": (csv([*ROWS[:10], "1,2,x"]), {"line": 18}),
    "unknown_format.docx": ("PK", {"message": ""}),
    "broken.modes.json": ('{"schema": "shm.modes/1",', {"line": 1, "message": "not JSON"}),
    "no_modes.modes.json": ('{"schema": "shm.modes/1", "hanger": 3}', {"message": "tests"}),
}


def reason_of(workspace: Workspace, name: str) -> dict[str, Any]:
    path = workspace.folder / "quarantine" / f"{name}.reason.json"
    reason: dict[str, Any] = json.loads(path.read_text())
    return reason


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """A workspace through which all of the bad files went, and then a good one."""
    workspace = make_workspace(tmp_path_factory.mktemp("bad") / "bridge")
    for name, (content, _) in BAD.items():
        put(workspace.spool / name, content)
    write_test(workspace.spool / "zz_good.modes.json", workspace)
    ingest(workspace)
    return workspace


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_quarantined_with_a_reason_and_a_remedy(served: Workspace, name: str) -> None:
    content, expected = BAD[name]
    raw = content if isinstance(content, bytes) else content.encode()
    assert (served.folder / "quarantine" / name).read_bytes() == raw
    reason = reason_of(served, name)
    assert reason["file"] == name
    assert len(reason["remedy"]) > 8
    assert "internal error" not in reason["message"]
    for key in ("line", "channel"):
        assert key not in expected or reason[key] == expected[key]
    assert re.search(expected.get("message", ""), reason["message"])


def test_the_good_file_behind_them_is_done(served: Workspace) -> None:
    with served.store() as store:
        counts = count_stages(store)
        assert (counts[Stage.REFUSED], counts[Stage.DONE]) == (len(BAD), 1)
        assert list(list_selected_models(store)) == [3]
    assert [path for path in served.spool.rglob("*") if path.is_file()] == []


def test_every_refused_file_is_kept_in_the_archive(served: Workspace) -> None:
    with served.store() as store:
        refused = list_recordings(store, Stage.REFUSED)
    assert all(served.archive.holds(recording.file) for recording in refused)
    assert {recording.file.file_name for recording in refused} == set(BAD)


def test_a_file_mended_by_a_sidecar_is_taken_when_dropped_again(workspace: Workspace) -> None:
    """No rate in the file: refused for that. With a sidecar the same bytes get further."""
    content, _ = BAD["no_rate.csv"]
    put(workspace.spool / "no_rate.csv", content)
    ingest(workspace)
    assert "sampling" in reason_of(workspace, "no_rate.csv")["message"]
    put(workspace.spool / "no_rate.toml", "sampling_rate_hz = 512.0\n")
    put(workspace.spool / "no_rate.csv", content)
    ingest(workspace)
    assert "sampling" not in reason_of(workspace, "no_rate.csv")["message"]
    with workspace.store() as store:
        assert [event.subject for event in list_events(store, "reopened")] == ["no_rate.csv"]
        assert len(list_recordings(store)) == 1
    assert (workspace.folder / "quarantine" / "no_rate.toml").is_file()
