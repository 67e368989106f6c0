"""How soon every page and figure of the dashboard is answered, with years of tests in the store.

    python tests/benchmarks/dashboard.py --hangers 200 --tests 250 --write-docs

A real server answers on this machine. Every page is asked for of several hangers, one after the
other, with all figures and parts that it fetches, and all else that can be read under `/api`. What
is worked out beside (202, or Retry-After) is waited for and asked for again; each answer is timed.
Fails where one takes longer than the limit; where others keep the machine busy, where one has had
more than that of the processor: the page says which of the two was judged.
"""

from __future__ import annotations

import argparse
import os
import re
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import httpx

from docs.filling import fill_in, write_csv
from shm.store import Workspace
from shm_cli.common import markdown
from tests.benchmarks.dashboard_filling import filled
from tests.helpers.footprint import resident_mb

TRIALS = Path(__file__).resolve().parents[2] / "docs" / "trials"
SHOWN = 5
"""Addresses in the page; the others are in the table beside it."""
LIMIT_MS = 300.0
PATIENCE_S = 120.0
QUIET_LOAD = 0.25
"""Of each processor: with more, others hold answers up."""
PAGES = ("/", "/alerts", "/upload", "/operation", "/hangers/{hanger}", "/hangers/{hanger}/tests")
TEST_PAGE = "/hangers/{hanger}/tests/{test}"
_FETCHED = re.compile(r'(?:data-figure|data-fragment|src)="(/[^"]+)"|<link[^>]+href="(/[^"]+)"')
Times = Mapping[str, list[tuple[float, float]]]
"""Milliseconds until each answer, and those that the server had of the processor meanwhile, by
address with the hanger and the test taken out."""


@contextmanager
def server(workspace: Workspace) -> Iterator[tuple[httpx.Client, int]]:
    """The web interface as a process of its own; its number."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = [
        sys.executable,
        "-m",
        "shm_daemon.web",
        str(workspace.folder),
        "127.0.0.1",
        str(port),
    ]
    log = (workspace.folder / "web.log").open("ab")
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=log)
    try:
        with httpx.Client(
            base_url=f"http://127.0.0.1:{port}", trust_env=False, timeout=60
        ) as client:
            _wait_until_up(client)
            yield client, process.pid
    finally:
        process.communicate()


def _wait_until_up(client: httpx.Client) -> None:
    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            client.get("/health")
            return
        except httpx.TransportError:
            if time.monotonic() > end:
                raise
            time.sleep(0.2)


def _worked_ms(pid: int) -> float:
    """What the threads of a process have had of the processors."""
    each = (task / "schedstat" for task in Path(f"/proc/{pid}/task").iterdir())
    return sum(int(path.read_text().split()[0]) for path in each) / 1e6


class Visitor:
    """Asks, and remembers how long each answer took."""

    def __init__(self, client: httpx.Client, pid: int):
        self._client, self._pid = client, pid
        self.times: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)
        self.failed: set[str] = set()

    def visit(self, address: str, label: str) -> str:
        """The text of an address, once it is worked out; each answer on the way is timed."""
        end = time.monotonic() + PATIENCE_S
        while True:
            began, worked_ms = time.perf_counter(), _worked_ms(self._pid)
            answer = self._client.get(address)
            taken_ms = 1e3 * (time.perf_counter() - began)
            self.times[label].append((taken_ms, _worked_ms(self._pid) - worked_ms))
            wait_s = answer.headers.get("Retry-After")
            if wait_s is None or answer.status_code >= 400 or time.monotonic() > end:
                break
            time.sleep(float(wait_s))
        is_down = answer.status_code >= 500 and label != "/health"  # no daemon runs here
        if is_down or time.monotonic() > end:
            self.failed.add(f"{label}: {answer.status_code} {answer.text[:200]}")
        return answer.text if "html" in answer.headers.get("Content-Type", "") else ""

    def visit_all(self, page: str, values: Mapping[str, str]) -> None:
        """A page and all that it fetches."""
        text = self.visit(_address(page, values), page)
        fetched = {one or other for one, other in _FETCHED.findall(text)}
        for address in sorted(fetched):
            self.visit(address.replace("&amp;", "&"), _label(address, values))


def _address(page: str, values: Mapping[str, str]) -> str:
    return page.format(**{name: quote(value, safe="") for name, value in values.items()})


def _label(address: str, values: Mapping[str, str]) -> str:
    plain = address.partition("?")[0]
    plain = plain.replace(f"/tests/{quote(values['test'], safe='')}", "/tests/{test}")
    return re.sub(r"/hangers/\d+", "/hangers/{hanger}", plain)


def readable(client: httpx.Client) -> list[str]:
    """What can be read under `/api`, but for figures, which the pages name."""
    paths = client.get("/openapi.json").json()["paths"]
    found = [path for path, verbs in paths.items() if "get" in verbs]
    known = {"hanger_id": "{hanger}", "hanger": "{hanger}", "test_name": "{test}"}
    known |= {"test": "{test}", "recording_id": "1", "alert_id": "1"}
    return [
        re.sub(r"{(\w+)(?::\w+)?}", lambda match: known[match[1]], path)
        for path in found
        if set(re.findall(r"{(\w+)", path)) <= set(known)
    ]


def ask(workspace: Workspace, rounds: int) -> tuple[Visitor, float]:
    """Visits every page of several hangers; the memory of the server at the end, in MB."""
    ids = [hanger.id for hanger in workspace.bridge.hangers]
    with workspace.store() as store:
        names = {
            hanger: [row.name for row in store.tests.list_rows(hanger, 10)]
            for hanger in (ids[len(ids) * place // rounds] for place in range(rounds))
        }
    with server(workspace) as (client, pid):
        visitor = Visitor(client, pid)
        api = readable(client)
        for place, (hanger, tests) in enumerate(names.items()):
            values = {"hanger": str(hanger), "test": tests[place % len(tests)]}
            for page in (*PAGES, TEST_PAGE, *api):
                visitor.visit_all(page, values)
        return visitor, resident_mb(pid)


_HEADS = (
    "address", "answers", "median, ms", "worst, ms",
    "of it the processor, median, ms", "processor, worst, ms",
)  # fmt: skip


def rows(times: Times) -> Iterable[tuple[str, ...]]:
    """Texts under `_HEADS`, the slowest address first."""
    for label, each in sorted(times.items(), key=lambda item: (-_worst_ms(item[1])[0], item[0])):
        taken, worked = (statistics.median(values) for values in zip(*each, strict=True))
        milliseconds = (taken, _worst_ms(each)[0], worked, _worst_ms(each)[1])
        yield (label, str(len(each)), *(f"{value:.0f}" for value in milliseconds))


def table(lines: Iterable[tuple[str, ...]]) -> str:
    marked = [(f"`{label}`", *cells) for label, *cells in lines]
    return markdown(_HEADS, marked)


def _worst_ms(each: Iterable[tuple[float, float]]) -> tuple[float, float]:
    """The longest answer, and the most that one had of the processor."""
    taken, worked = zip(*each, strict=True)
    return max(taken), max(worked)


def _on_what(load: float, is_busy: bool, held_mb: float) -> str:
    """How busy the machine was, and so what was judged."""
    judged = (
        "others kept it busy, so the limit was held against the time of the processor"
        if is_busy
        else "the limit was held against the time until the answer"
    )
    return (
        f"Measured with a load of {load:.1f} on {os.cpu_count()} processors before it began: "
        f"{judged}. The server held {held_mb:.0f} MB."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hangers", type=int, default=200)
    parser.add_argument("--tests", type=int, default=250, help="of each hanger")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--folder", type=Path, help="keep the workspace here, or take it from here")
    parser.add_argument("--write-docs", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = options.folder or Path(name) / "bridge"
        began = time.monotonic()
        if folder.exists():
            workspace = Workspace.open(folder)
        else:
            workspace = filled(folder, options.hangers, options.tests)
            print(f"filled in {time.monotonic() - began:.0f} s")
        load = os.getloadavg()[0]
        visitor, held_mb = ask(workspace, options.rounds)
    is_busy = load > QUIET_LOAD * (os.cpu_count() or 1)
    late = [label for label, each in visitor.times.items() if _worst_ms(each)[is_busy] > LIMIT_MS]
    found, on_what = list(rows(visitor.times)), _on_what(load, is_busy, held_mb)
    print(f"{on_what}\n\n{table(found)}")
    if visitor.failed or late:
        print("\n".join([*sorted(visitor.failed), *(f"over {LIMIT_MS:.0f} ms: {x}" for x in late)]))
        raise SystemExit(1)
    if options.write_docs:
        write_csv(TRIALS / "dashboard.csv", [_HEADS, *found])
        said = f"{on_what} Of {len(found)} addresses ([all](dashboard.csv)) the slowest:"
        fill_in(TRIALS / "load.md", "dashboard", f"{said}\n\n{table(found[:SHOWN])}")


if __name__ == "__main__":
    main()
