"""`[[publish]]` tables: what they say, and what is wrong with others."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.bridge.publish import publication_of
from shm.errors import BadInput

PATH = Path("bridge.toml")
LOCAL = {"kind": "influx", "url": "http://localhost:8086"}


def test_publication_of_database() -> None:
    found = publication_of({**LOCAL, "database": "my shm"}, PATH)

    assert (found.name, found.needs_token) == ("influx", False)
    assert found.write_url == "http://localhost:8086/write?db=my+shm"


def test_publication_of_bucket() -> None:
    values = {"organisation": "city", "bucket": "shm", "token_env": "TOKEN", "name": "cloud"}
    found = publication_of({**LOCAL, **values}, PATH)

    assert (found.name, found.needs_token) == ("cloud", True)
    assert found.write_url.endswith("/api/v2/write?org=city&bucket=shm&precision=ns")


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"kind": "graphite"}, "kind = 'graphite' is not known"),
        ({"url": "localhost"}, "url is not an address of the web"),
        ({"url": "http://example.org"}, "url is not encrypted"),
        ({"url": "http://me:secret@localhost"}, "url holds a user or password"),
        ({"token": "secret"}, "bridge.toml is no place for a token"),
        ({"database": ""}, "it needs either a database or a bucket"),
        ({"bucket": "b", "organisation": "o"}, "it needs either a database or a bucket"),
        ({"database": "", "bucket": "b"}, "organisation and bucket belong together"),
        ({"token_file": "a", "token_env": "B"}, "it has both token_file and token_env"),
        ({"databse": "shm"}, "unknown key databse"),
    ],
)
def test_publication_of_refuses(changes: dict[str, str], problem: str) -> None:
    with pytest.raises(BadInput) as refused:
        publication_of({**LOCAL, "database": "shm", **changes}, PATH)

    assert problem in refused.value.message
    assert "secret" not in str(refused.value).replace('"influx.token"', "")
    assert refused.value.remedy
