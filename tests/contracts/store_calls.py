"""Fixed workspace and calls of the contract of store, flow and daemon, and how they are compared.

`write_store_golden.py` makes the golden files from them, `test_store_contract.py` compares.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

import shm
from shm.documents import alert_document, dump
from shm.store import Workspace
from tests.contracts.inference_calls import GOLDEN, call
from tests.helpers import quick_update
from tests.helpers.flows import Clock, Postman, ingest
from tests.helpers.web_servers import served
from tests.helpers.workspaces import make_workspace, put, write_held, write_loss

FOLDER = GOLDEN / "store"
VERBS: Mapping[str, tuple[str, ...]] = {
    "status": ("status",),
    "status_of": ("status", "--of", "t2"),
    "alerts": ("alerts",),
    "held": ("ingest", "--held"),
    "check": ("db", "check", "--archive"),
    "doctor": ("doctor",),
}
"""Calls of `shm`, by the name of their golden file."""
ADDRESSES = (
    "/api/bridge",
    "/api/bridge/summary",
    "/api/hangers",
    "/api/hangers/3",
    "/api/alerts",
    "/api/operation",
    "/api/streams",
)
"""Documents over HTTP, all in `api.json`."""
CHUNK = json.dumps(
    {
        "schema": "shm.chunk/1",
        "stream": "h3",
        "sequence": 17,
        "time": "2026-05-01T10:00:00Z",
        "sampling_rate_hz": 200,
        "channels": ["acc_1", "acc_2"],
        "temperature_c": 11.5,
        "encoding": "float32",
    }
)
"""Line of JSON of a chunk; four bytes a sample and channel follow it."""

PATTERNS = {
    r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(\.\d+)?(\+00:00|Z)?": "<time>",
    r"\b[0-9a-f]{64}\b": "<sha256>",
    re.escape(shm.__version__): "<version>",
}
MACHINE = ("clock", "disk", "memory")
"""Checks of `doctor` whose level depends on the machine."""
VOCABULARY = ("check", "kinds", "kind", "stage")
"""Keys whose texts are names that programs compare with."""
OF_MACHINE = ("found", "disk_free_bytes", "disk_bytes")
"""Keys whose values depend on the machine."""
NOT_PROMISED = ("damaged", "missing")
"""Keys of findings about single rows: SQLite and PostgreSQL check what they hold themselves."""
DROPPED = ("damage",)
"""Keys left out of any document, for the same reason."""
TABLES = ("alerts", "posteriors", "recordings", "tests")
"""Tables whose rows `db check` and `db backup` count for programs; others may come and go."""


def make_bridge(folder: Path) -> Workspace:
    """Return a bridge of two hangers with a loss, an open alert, a held test and a refused file."""
    hooks = {"mail": ["true"]}
    workspace = make_workspace(folder / "bridge", hangers=(3, 4), hooks=hooks)
    write_loss(workspace.spool, workspace)
    write_held(workspace, 4)
    put(workspace.spool / "bad.modes.json", '{"schema": "shm.modes/1", "hanger": 3, "tests": []}')
    with pytest.MonkeyPatch.context() as patch:
        quick_update.stand_in(patch.setattr)
        ingest(workspace, clock=Clock(), notifier=Postman())
    return workspace


def run_all(workspace: Workspace) -> dict[str, Any]:
    """Return every document of the contract, by the name of its golden file."""
    made = {name: run(workspace, *words) for name, words in VERBS.items()}
    promise_checked(made["check"]["document"])
    for each in made["doctor"]["document"]["findings"]:
        if each["check"] in MACHINE:
            each["level"] = each["remedy"] = "<machine>"
    with served(workspace) as site, site.client(site.read_token) as client:
        made["api"] = {path: client.get(path).raise_for_status().json() for path in ADDRESSES}
        made["paths"] = sorted(
            f"{verb.upper()} {path}"
            for path, verbs in client.get("/openapi.json").json()["paths"].items()
            for verb in verbs
        )
    reasons = sorted(workspace.quarantine.folder.glob("*.reason.json"))
    made["reason"] = [json.loads(path.read_text()) for path in reasons]
    with workspace.store() as store:
        alerts = [alert_document(each.alert) for each in store.alerts.list_all()]
        made["alert"] = json.loads(dump(alerts))
    exact = ("reason", "paths")
    return {n: normalise(d, workspace.folder, exact=n in exact) for n, d in made.items()}


def run(workspace: Workspace, *words: str) -> Any:
    """Return the document of one command, whatever its exit code."""
    ended = call("--workspace", workspace.folder, *words, "--json")
    return {"exit_code": ended.code, "document": json.loads(ended.out)}


def promise_checked(document: dict[str, Any]) -> None:
    """Leave of a document of `db check` what is promised."""
    rows = [each for each in document["tables"] if each["table"] in TABLES]
    document["tables"] = sorted(rows, key=lambda each: str(each["table"]))
    for key in NOT_PROMISED:
        document.pop(key, None)


def normalise(value: Any, folder: Path, key: str = "", *, exact: bool = False) -> Any:
    """Return a document without clocks, paths, versions and measured numbers.

    Of texts it keeps that they are texts, unless `exact`: their words may change.
    """
    if isinstance(value, dict):
        kept = {k: v for k, v in value.items() if k not in DROPPED}
        return {k: normalise(v, folder, k, exact=exact) for k, v in kept.items()}
    if isinstance(value, list):
        return [normalise(each, folder, key, exact=exact) for each in value]
    if key in OF_MACHINE:
        return "<machine>"
    if isinstance(value, float):
        return "<number>"
    if not isinstance(value, str):
        return value
    text = value.replace(str(folder), "<workspace>")
    for pattern, name in PATTERNS.items():
        text = re.sub(pattern, name, text)
    return "<text>" if " " in text and not exact and key not in VOCABULARY else text


def golden(name: str) -> Any:
    """Return a golden file."""
    return json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
