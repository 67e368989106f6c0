"""The first file of a logger over HTTP: looked into, asked about, taken in."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pytest

from shm.store import Workspace
from tests.helpers.web_servers import Served, served

HEAD = "Abtastrate;500 Hz\nZeit [s];Kraft [N];A1 [g];AI 2 [V]\n"


@pytest.fixture
def site(workspace: Workspace) -> Iterator[Served]:
    with served(workspace) as site:
        yield site


@pytest.fixture
def client(site: Served) -> Iterator[httpx.Client]:
    with site.client(Authorization=f"Bearer {site.write_token}") as client:
        yield client


def export(seed: int, rows_: int = 600) -> bytes:
    rng = np.random.default_rng(seed)
    rows = "".join(f"{i / 500:.3f};{a:.4f};{b:.4f};{c:.4f}\n" for i, (a, b, c) in enumerate(
        rng.normal(size=(rows_, 3))
    ))  # fmt: skip
    return (HEAD + rows.replace(".", ",")).encode("latin-1")


def asked(client: httpx.Client, content: bytes, said: Any = None, name: str = "a.csv") -> Any:
    query = {"name": name, **({} if said is None else {"said": json.dumps(said)})}
    return client.post("/api/imports", params=query, content=content)


def test_a_look_keeps_nothing_and_asks_what_the_file_does_not_say(
    client: httpx.Client, workspace: Workspace
) -> None:
    found = asked(client, export(1)).json()
    assert [(q["about"], q["channel"]) for q in found["questions"]] == [
        ("hanger", ""), ("unit", "AI 2"), ("place", "Kraft"), ("place", "A1"), ("plane", "A1"),
    ]  # fmt: skip
    assert [c["quantity"] for c in found["columns"]] == ["force", "acceleration", None]
    assert len(found["columns"][0]["outline"]) == 32
    assert found["sha256"] is None
    assert not [path for path in workspace.spool.iterdir() if path.is_file()]


def test_answers_are_kept_for_the_logger_and_the_file_lands(
    client: httpx.Client, workspace: Workspace
) -> None:
    said = {
        "hanger": 3,
        "columns": {"A1": {"place": "2,5", "plane": "transverse"}, "AI 2": {"unit": "leave out"}},
    }
    found = asked(client, export(1), said).json()
    assert [question["channel"] for question in found["questions"]] == ["Kraft"]
    assert found["problems"] == []
    assert found["sha256"]  # the hammer's place is asked for, not needed
    told = tomllib.loads((workspace.spool / "a.toml").read_text())
    assert told["channel"]["A1"] == {"x_m": 2.5, "plane": "transverse"}
    assert asked(client, export(2), {}, "b.csv").json()["sha256"]


@pytest.mark.parametrize(
    "said",
    [
        [], {"columns": 3}, {"columns": {"A1": 3}}, {"columns": {"A9": {"plane": "t"}}},
        {"columns": {"A1": {"plane": "up"}}}, {"hanger": "three"}, {"sampling_rate_hz": -1},
    ],
)  # fmt: skip
def test_answers_that_are_none_are_refused_with_words(client: httpx.Client, said: Any) -> None:
    answer = asked(client, export(1), said)
    assert answer.status_code == 422
    assert answer.json()["remedy"]


def test_what_cannot_be_read_is_refused_with_its_reason(client: httpx.Client) -> None:
    assert asked(client, b"some words\nin lines\n").json()["problems"]
    assert asked(client, b"\x89PNG\r\n\x1a\n").status_code == 422
    assert client.post("/api/imports?name=a.csv", content=b"").status_code == 422


def test_a_file_as_long_as_loggers_write_is_looked_into(client: httpx.Client) -> None:
    assert asked(client, export(1, 40_000)).json()["samples"] == 40_000
