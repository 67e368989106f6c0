"""Uploads 500 MB through the web interface as its owner begins it; prints throughput and memory.

python -m tests.benchmarks.upload [MEGABYTES]
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import httpx

from shm.pipeline import utc_now
from shm.store import Scope
from tests.helpers.daemons import ROOT
from tests.helpers.workspaces import make_workspace

PORT = 18_423
PIECE = bytes(1_000_000)


def main(megabytes: int) -> None:
    """Begins a server, uploads once small and once large, and compares its peak memory."""
    with tempfile.TemporaryDirectory() as folder:
        workspace = make_workspace(Path(folder) / "bridge")
        with workspace.store() as store:
            token = store.upkeep.create_token("benchmark", Scope.WRITE, utc_now())
        command = [sys.executable, "-m", "shm_daemon.web", str(workspace.folder), "127.0.0.1"]
        with subprocess.Popen(
            [*command, str(PORT)], cwd=ROOT, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL
        ) as server:
            headers = {"Authorization": f"Bearer {token}"}
            url = f"http://127.0.0.1:{PORT}"
            with httpx.Client(base_url=url, headers=headers, timeout=600) as client:
                _until_up(client)
                _upload(client, 1)
                before_mb = _peak_mb(server.pid)
                seconds = _upload(client, megabytes)
                print(f"{megabytes} MB in {seconds:.1f} s: {megabytes / seconds:.0f} MB/s")
                print(f"peak memory {before_mb:.0f} MB before, {_peak_mb(server.pid):.0f} MB after")
            server.kill()


def _until_up(client: httpx.Client) -> None:
    while True:
        try:
            client.get("/health")
            return
        except httpx.ConnectError:
            time.sleep(0.1)


def _upload(client: httpx.Client, megabytes: int) -> float:
    def pieces() -> Iterator[bytes]:
        for _ in range(megabytes):
            yield PIECE

    began = time.monotonic()
    answer = client.post("/api/recordings?name=large.csv", content=pieces())
    answer.raise_for_status()
    assert answer.json()["size_bytes"] == megabytes * len(PIECE)
    return time.monotonic() - began


def _peak_mb(pid: int) -> float:
    found = re.search(r"VmHWM:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
    assert found is not None
    return int(found[1]) / 1000


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("megabytes", nargs="?", type=int, default=500)
    main(parser.parse_args().megabytes)
