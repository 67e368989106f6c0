"""How soon every page and figure of the dashboard is answered, with years of tests in the store.

    python tests/benchmarks/dashboard.py --hangers 200 --tests 250 --write-docs

A real server answers on this machine. An engineer has signed in and asks for every route of the
interface that only reads, of several hangers, one after the other, with all figures and parts that
the pages fetch; then for each address once as the first after a start. What is worked out beside
(202, or Retry-After) is waited for and asked for again; each answer is timed. Fails where a route
was not asked for, where an answer is a fault, and where one takes longer than the limit; where
others keep the machine busy, where one has had more than that of the processor: the page says which
of the two was judged.
"""

from __future__ import annotations

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

import begin
import httpx
from fastapi.routing import APIRoute

from docs.filling import fill_in, write_csv
from shm.store import Workspace
from shm.store.tests import list_test_rows
from shm_cli.common import markdown
from shm_daemon.web.address import Address
from shm_daemon.web.app import make_pages
from shm_daemon.web.site import Description, Site
from tests.benchmarks.dashboard_filling import (
    ENGINEER,
    PASSWORD,
    RECORDED_EVERY,
    filled,
    is_recorded,
)
from tests.helpers.footprint import resident_mb

TRIALS = begin.TRIALS
SHOWN = 5
"""Addresses in the page; the others are in the table beside it."""
LIMIT_MS = 300.0
PATIENCE_S = 120.0
QUIET_LOAD = 0.25
"""Of each processor: with more, others hold answers up."""
WARM_S = 0.5
"""Technical: a server that has done next to nothing for so long has warmed up."""
VALUES = {
    "hanger_id": "{hanger}",
    "test": "{test}",
    "recording_id": "1",
    "alert_id": "1",
    "key": "1",
    "number": "1",
    "form": "html",
}
"""What stands for the parameters of a route; `hanger` and `test` are filled in each round."""
NAMES = {"/streams/{name}": "h1", "/api/streams/{name}/figure": "h1"}
"""What stands for `name`; other routes with a name are asked for by the pages."""
QUERIES = {
    "/compare": ("", "?hanger={hanger}&hanger=1&hanger=2"),
    "/settings": ("", "?hanger={hanger}"),
    "/api/recordings": (f"?sha256={1:064x}",),
    "/streams/{name}": ("", "?days=800"),
    "/api/streams/{name}/figure": ("", "?days=800"),
    "/api/compare/figure": ("?hanger={hanger}&hanger=1&hanger=2",),
}
"""How a route is asked for where it is not by its path alone."""
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
            base_url=f"http://127.0.0.1:{port}", trust_env=False, timeout=PATIENCE_S
        ) as client:
            _wait_until_up(client)
            form = {"name": ENGINEER, "password": PASSWORD, "next": "/upload"}
            client.post("/sign-in", data=form, headers={"Origin": str(client.base_url)})
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
    """What a process has had of the processors: its clock, as Linux numbers it."""
    return 1e3 * time.clock_gettime((~pid << 3) | 2)


class Visitor:
    """Asks, and remembers how long each answer took."""

    def __init__(self, client: httpx.Client, pid: int):
        self._client, self._pid = client, pid
        self.addresses: dict[str, str] = {}
        self.times: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)
        self.failed: set[str] = set()

    def visit(self, address: str, label: str) -> str:
        """The text of an address, once it is worked out; each answer on the way is timed."""
        end = time.monotonic() + PATIENCE_S
        self.addresses[label] = address
        while True:
            began, worked_ms = time.perf_counter(), _worked_ms(self._pid)
            answer = self._client.get(address)
            taken_ms = 1e3 * (time.perf_counter() - began)
            self.times[label].append((taken_ms, _worked_ms(self._pid) - worked_ms))
            wait_s = answer.headers.get("Retry-After")
            if wait_s is None or answer.status_code >= 400 or time.monotonic() > end:
                break
            time.sleep(float(wait_s))
        is_fault = answer.status_code >= 400 and label != "/health"  # no daemon runs here
        if is_fault or time.monotonic() > end:
            self.failed.add(f"{label}: {answer.status_code} {answer.text[:200]}")
        return answer.text if "html" in answer.headers.get("Content-Type", "") else ""

    def visit_all(self, page: str, values: Mapping[str, str]) -> None:
        """A page and all that it fetches."""
        text = self.visit(_address(page, values), _label(page, values))
        fetched = {one or other for one, other in _FETCHED.findall(text)}
        for address in sorted(fetched):
            self.visit(address.replace("&amp;", "&"), _label(address, values))


def _address(page: str, values: Mapping[str, str]) -> str:
    return page.format(**{name: quote(value, safe="") for name, value in values.items()})


def _label(address: str, values: Mapping[str, str]) -> str:
    plain, _, query = address.partition("?")
    plain = plain.replace(f"/tests/{quote(values['test'], safe='')}", "/tests/{test}")
    plain = re.sub(
        r"/streams/h1\b", "/streams/{stream}", re.sub(r"/hangers/\d+", "/hangers/{hanger}", plain)
    )
    return plain + (f"?{query}" if "days" in query else "")


def routes_of(workspace: Workspace) -> list[APIRoute]:
    """All of the interface that is asked for with GET."""
    pages = make_pages(Site(Description(workspace), Address()))
    routers = [getattr(each, "original_router", each) for each in pages.routes]
    found = [route for each in routers for route in getattr(each, "routes", [each])]
    return [each for each in found if isinstance(each, APIRoute) and "GET" in each.methods]


def asked_for(routes: Iterable[APIRoute]) -> Iterator[str]:
    """Addresses of all routes whose parameters are known, with `{hanger}` and `{test}`."""
    for route in routes:
        path = re.sub(r"{(\w+):\w+}", r"{\1}", route.path)
        values = VALUES | ({"name": NAMES[path]} if path in NAMES else {})
        if set(re.findall(r"{(\w+)", path)) <= set(values):
            yield from (path.format_map(values) + query for query in QUERIES.get(path, ("",)))


def ask(workspace: Workspace, rounds: int) -> tuple[Visitor, float]:
    """Visits every page of several hangers; the memory of the server at the end, in MB."""
    ids = [hanger.id for hanger in workspace.bridge.hangers]
    with workspace.store() as store:
        names = {
            hanger: [
                row.name
                for row in list_test_rows(store, hanger, 10 * RECORDED_EVERY)
                if is_recorded(row.name)
            ]
            for hanger in (ids[len(ids) * place // rounds] for place in range(rounds))
        }
    routes = routes_of(workspace)
    with server(workspace) as (client, pid):
        _wait_until_warm(pid)
        visitor = Visitor(client, pid)
        for place, (hanger, tests) in enumerate(names.items()):
            values = {"hanger": str(hanger), "test": tests[place % len(tests)]}
            for page in asked_for(routes):
                visitor.visit_all(page, values)
        held_mb = resident_mb(pid)
    paths = [address.partition("?")[0] for address in visitor.addresses.values()]
    visitor.failed |= {
        f"{route.path}: nobody asked for it"
        for route in routes
        if not any(route.path_regex.match(path) for path in paths)
    }
    return visitor, held_mb


def first_ms(workspace: Workspace, addresses: Mapping[str, str]) -> dict[str, tuple[float, float]]:
    """As the first after a start: milliseconds until each answer, and those of the processor."""
    found = {}
    for label, address in addresses.items():
        if label.startswith("/static"):
            continue
        with server(workspace) as (client, pid):
            _wait_until_warm(pid)
            began, worked_ms = time.perf_counter(), _worked_ms(pid)
            client.get(address)
            found[label] = (1e3 * (time.perf_counter() - began), _worked_ms(pid) - worked_ms)
    return found


def _wait_until_warm(pid: int) -> None:
    before_ms = -1e9
    while (now_ms := _worked_ms(pid)) - before_ms > 20 * WARM_S:
        before_ms = now_ms
        time.sleep(WARM_S)


_HEADS = (
    "address", "answers", "median, ms", "worst, ms", "of it the processor, median, ms",
    "processor, worst, ms", "first after a start, ms", "processor, ms",
)  # fmt: skip


def rows(times: Times, first: Mapping[str, tuple[float, float]]) -> Iterable[tuple[str, ...]]:
    """Texts under `_HEADS`, the slowest address first."""

    def worst_ms(label: str) -> tuple[float, float]:
        """The longest answer, and the most that one had of the processor."""
        taken, worked = zip(*times[label], strict=True)
        return max(taken), max(worked)

    for label in sorted(times, key=lambda each: (-worst_ms(each)[1], each)):
        taken, worked = (statistics.median(each) for each in zip(*times[label], strict=True))
        milliseconds = (taken, worst_ms(label)[0], worked, worst_ms(label)[1])
        told = [f"{value:.0f}" for value in (*milliseconds, *first.get(label, ()))]
        yield (label, str(len(times[label])), *told, *[""] * (6 - len(told)))


def late(times: Times, first: Mapping[str, tuple[float, float]], is_busy: bool) -> Iterator[str]:
    """What took longer than the limit, on the clock or, on a busy machine, of the processor."""
    for label, each in times.items():
        # A report is worked out beside, and waited for: of the server it takes its processor alone.
        judged = is_busy or "/report." in label
        worst_ms = max(one[judged] for one in each)
        if worst_ms > LIMIT_MS:
            yield f"over {LIMIT_MS:.0f} ms: {label}"
        elif first.get(label, (0.0, 0.0))[judged] > LIMIT_MS:
            yield f"over {LIMIT_MS:.0f} ms as the first after a start: {label}"


def table(lines: Iterable[tuple[str, ...]]) -> str:
    marked = [(f"`{label}`", *cells) for label, *cells in lines]
    return markdown(_HEADS, marked)


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
    options = begin.options(
        __doc__,
        hangers=200,
        tests=begin.Told(250, "of each hanger"),
        rounds=5,
        warm_only=begin.Told(False, "no first answers after a start"),
        folder=begin.Told(Path, "keep the workspace here, or take it from here"),
        write_docs=False,
    )
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
        first = {} if options.warm_only else first_ms(workspace, visitor.addresses)
    is_busy = load > QUIET_LOAD * (os.cpu_count() or 1)
    found = list(rows(visitor.times, first))
    on_what = _on_what(load, is_busy, held_mb)
    print(f"{on_what}\n\n{table(found)}")
    faults = [*sorted(visitor.failed), *late(visitor.times, first, is_busy)]
    if faults:
        print("\n".join(faults))
        raise SystemExit(1)
    if options.write_docs:
        write_csv(TRIALS / "dashboard.csv", [_HEADS, *found])
        said = f"{on_what} Of {len(found)} addresses ([all](dashboard.csv)) the slowest:"
        fill_in(TRIALS / "load.md", "dashboard", f"{said}\n\n{table(found[:SHOWN])}")


if __name__ == "__main__":
    main()
