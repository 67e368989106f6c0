"""Real time-series databases of a test's own, where their Debian packages are installed."""

from __future__ import annotations

import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

from tests.helpers.waiting import until

_INFLUX = """
reporting-disabled = true
bind-address = "127.0.0.1:{rpc}"
[meta]
dir = "{folder}/meta"
[data]
dir = "{folder}/data"
wal-dir = "{folder}/wal"
[http]
bind-address = "127.0.0.1:{port}"
auth-enabled = {auth}
"""


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


@dataclass
class Database:
    """A server that runs while its block lasts, and may be stopped and begun again."""

    command: list[str]
    url: str
    log: Path
    process: subprocess.Popen[bytes] | None = None

    def begin(self) -> None:
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(self.command, stdout=log, stderr=log)
        until(self._answers, 60.0)

    def stop(self) -> None:
        if self.process is not None:
            self.process.terminate()
            self.process.wait(30.0)
            self.process = None

    def _answers(self) -> bool:
        try:
            return httpx.get(f"{self.url}/ping").status_code < 500
        except httpx.TransportError:
            return False

    def influxql(self, query: str, **words: str) -> list[dict[str, object]]:
        """Return the rows of the answer, each with its tags."""
        answer = httpx.post(f"{self.url}/query", params={"q": query, "db": "shm", **words})
        answer.raise_for_status()
        return [
            {**series.get("tags", {}), **dict(zip(series["columns"], row, strict=True))}
            for result in answer.json()["results"]
            for series in result.get("series", ())
            for row in series["values"]
        ]

    def promql(self, query: str) -> list[dict[str, object]]:
        """Return the series of a query over a year before and after now."""
        httpx.get(f"{self.url}/internal/force_flush")
        now, step_s = time.time(), 10 * 86400
        words = {"query": query, "start": now - 36 * step_s, "end": now + step_s, "step": step_s}
        answer = httpx.get(f"{self.url}/api/v1/query_range", params=words)
        answer.raise_for_status()
        found: list[dict[str, object]] = answer.json()["data"]["result"]
        return found

    def export(self, name: str) -> list[dict[str, object]]:
        """Return the series of VictoriaMetrics whose name begins so, with all their values."""
        httpx.get(f"{self.url}/internal/force_flush")
        words: dict[str, str | float] = {"match[]": f'{{__name__=~"{name}.*"}}'}
        # Without an end it is the present second's beginning.
        answer = httpx.get(f"{self.url}/api/v1/export", params={**words, "end": time.time() + 60})
        return [httpx.Response(200, text=line).json() for line in answer.text.splitlines()]


@contextmanager
def an_influxdb(folder: Path, *, auth: bool = False) -> Iterator[Database]:
    """InfluxDB 1; the test is skipped where it is not installed (`apt-get install influxdb`)."""
    program = _program("influxd", "influxdb")
    port, config = free_port(), folder / "influx.toml"
    text = _INFLUX.format(rpc=free_port(), port=port, folder=folder, auth=str(auth).lower())
    config.write_text(text)
    command = [program, "run", "-config", str(config)]
    yield from _running(Database(command, f"http://127.0.0.1:{port}", folder / "influx.log"))


@contextmanager
def a_victoria_metrics(folder: Path) -> Iterator[Database]:
    """VictoriaMetrics; skipped where it is not installed (`apt-get install victoria-metrics`)."""
    program, port = _program("victoria-metrics", "victoria-metrics"), free_port()
    command = [program, f"-httpListenAddr=127.0.0.1:{port}", f"-storageDataPath={folder}/vm"]
    command += ["-retentionPeriod=100y", "-search.latencyOffset=0s"]
    yield from _running(Database(command, f"http://127.0.0.1:{port}", folder / "vm.log"))


def _program(name: str, package: str) -> str:
    found = shutil.which(name)
    if found is None:
        pytest.skip(f"NOT TESTED against a real server: `apt-get install {package}` brings {name}")
    return found


def _running(database: Database) -> Iterator[Database]:
    database.begin()
    try:
        yield database
    finally:
        database.stop()
