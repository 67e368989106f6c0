"""The `[[publish]]` tables of `bridge.toml`: time-series databases that are given the results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from shm.bridge.table import Table, web_address

_KINDS = ("influx",)
_KEYS = (
    "kind", "name", "url", "database", "organisation", "bucket", "token_file", "token_env",
    "allow_http",
)  # fmt: skip
_WHERE_TOKENS_STAND = (
    'Write it into a file that only the daemon\'s user can read: token_file = "influx.token"; or '
    'name a variable of the environment: token_env = "NAME".'
)
_DATABASE_OR_BUCKET = (
    'Write database = "shm" for InfluxDB 1 and VictoriaMetrics, or organisation = "..." and '
    'bucket = "shm" for InfluxDB 2 and 3.'
)


@dataclass(frozen=True)
class Publication:
    """A database that takes InfluxDB's line protocol over HTTP.

    It has either a `database` (version 1) or an `organisation` and a `bucket` (version 2). The
    token stands in a file of the workspace's folder or in a variable of the environment; for
    version 1 it is `user:password`.
    """

    name: str
    url: str
    database: str = ""
    organisation: str = ""
    bucket: str = ""
    token_file: str = ""
    token_env: str = ""

    @property
    def write_url(self) -> str:
        """Return the address that points are posted to."""
        if self.bucket:
            words = {"org": self.organisation, "bucket": self.bucket, "precision": "ns"}
            return f"{self.url.rstrip('/')}/api/v2/write?{urlencode(words)}"
        return f"{self.url.rstrip('/')}/write?{urlencode({'db': self.database})}"

    @property
    def needs_token(self) -> bool:
        return bool(self.token_file or self.token_env)


def publication_of(values: Mapping[str, Any], path: Path) -> Publication:
    """Return the publication of a `[[publish]]` table; raises BadInput with key and remedy."""
    table = Table(values, f"publish {values.get('name', '?')}", path)
    if "token" in table or "password" in table:
        raise table.refusal("bridge.toml is no place for a token", _WHERE_TOKENS_STAND)
    table.refuse_unknown(_KEYS)
    table.value("kind", str, "is not known", 'Write kind = "influx".', holds=_KINDS.__contains__)
    url = web_address(
        table, "url", 'Write url = "http://localhost:8086".', "name a token_file instead"
    )
    texts = {
        key: table.text(key, "")
        for key in _KEYS
        if key not in ("kind", "name", "url", "allow_http")
    }
    if bool(texts["database"]) == bool(texts["bucket"]):
        raise table.refusal("it needs either a database or a bucket", _DATABASE_OR_BUCKET)
    if bool(texts["bucket"]) != bool(texts["organisation"]):
        raise table.refusal("organisation and bucket belong together", _DATABASE_OR_BUCKET)
    if texts["token_file"] and texts["token_env"]:
        raise table.refusal("it has both token_file and token_env", "Keep one of them.")
    return Publication(table.text("name", "influx"), url, **texts)
