"""The page of a hanger, its figures and its numbers, over HTTP."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import timedelta
from typing import Any, ClassVar

import httpx
import plotly.graph_objects as plotly
import pytest

from shm.pipeline.reporting import hanger_report
from shm.report.hanger_sentences import details
from shm.report.hanger_status import Status
from shm.report.states import NOTHING_WATCHED, StatesOverTime
from shm.store import Lineage, Workspace
from shm_daemon.web.background_work import BackgroundWorker, WorkRequest
from shm_daemon.web.commands import set_reader, without_commands
from shm_daemon.web.hanger_figures import FIGURES
from tests.helpers.flows import Clock, ingest
from tests.helpers.web_servers import Served, served, words_of
from tests.helpers.workspaces import START, make_workspace, write_loss, write_test
from tests.report.diagnoses import LED

_OF_OTHERS = {"stiffness", "control"}  # beam1 clamps its ends; no tension of it is known


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 lost a fifth of its tension and was diagnosed; hanger 4 has no tests."""
    folder = tmp_path_factory.mktemp("hanger") / "bridge"
    workspace = make_workspace(folder, hangers=(3, 4), settings={"models": "beam1,beam2"})
    for name, day in (("s1", 10), ("s2", 20)):  # a loss is detected against more tests than one
        write_test(workspace.spool / f"{name}.modes.json", workspace, day=day)
    write_loss(workspace.spool, workspace, lost=2)
    write_test(
        workspace.spool / "od d%3F.modes.json", workspace, day=75, tension=0.8, name="a/b ü?"
    )
    ingest(workspace, clock=Clock(START + timedelta(days=200)))
    with workspace.store() as store:
        store.posteriors.save_diagnosis(3, replace(LED, hanger=3), Lineage.of({}, {}), START)
    return workspace


class AtTheSecondRequest(BackgroundWorker[Any]):
    """A background_worker without a process: nothing is made yet when it is first asked for."""

    made: ClassVar[dict[WorkRequest, Any]] = {}

    def get_or_start(self, order: WorkRequest) -> Any:
        if order not in self.made:
            self.made[order] = None
            return None
        self.made[order] = self.made[order] or order.make()
        return self.made[order]


@pytest.fixture(scope="module")
def site(bridge: Workspace) -> Iterator[Served]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("shm_daemon.web.app.BackgroundWorker", AtTheSecondRequest)
        with served(bridge) as site:
            yield site


@pytest.fixture(scope="module")
def page(client: httpx.Client) -> str:
    return client.get("/hangers/3").text


def figures_of(page: str) -> list[str]:
    return re.findall(r'data-figure="/api/hangers/3/figures/([a-z_]+)"', page)


def figure(client: httpx.Client, name: str) -> dict[str, Any]:
    found = client.get(f"/api/hangers/3/figures/{name}")
    assert found.status_code == 200, found.text
    document: dict[str, Any] = found.json()
    return document


def names_in(document: dict[str, Any]) -> set[str]:
    return {trace.get("name", "") for trace in document["data"]}


def _plain(text: str) -> str:
    """Without the marks around commands, and the spaces that tags leave."""
    return re.sub(r"[`\s]", "", text)


def test_page_agrees_with_report(
    page: str, bridge: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_states: Callable[..., StatesOverTime] = lambda *_: NOTHING_WATCHED  # noqa: E731
    monkeypatch.setattr("shm.pipeline.reporting.hanger_states", without_states)
    with bridge.store() as store:
        report = hanger_report(bridge, store, 3, START)
    assert report.status is Status.ALERT
    said = _plain(words_of(page))
    set_reader(3, is_engineer=False)  # as the page does
    assert _plain(without_commands(report.now.message.words)) in said
    assert _plain(without_commands(details(report))) in said
    assert f'<span class="status alert">{Status.ALERT.value}</span>' in page
    for part in ("Where the gap lies", "Where along the hanger", "What causes the gap",
                 "point mass", "How far the gap shrinks"):  # fmt: skip
        assert part in words_of(page)


def test_figures_are_drawn_by_plotly(client: httpx.Client, page: str) -> None:
    """Nothing that a person reads is not a number."""
    assert set(figures_of(page)) == {each.member.name for each in FIGURES} - _OF_OTHERS
    documents = {name: figure(client, name) for name in figures_of(page)}
    for name, document in documents.items():
        drawn = plotly.Figure({key: document[key] for key in ("data", "layout")})
        assert any(trace for trace in drawn.data), name
        assert len(document["caption"]) > 40, name
        assert len(document["alt"]) > 20, name
    read = [page, client.get("/hangers/4").text]
    read += [f"{document['caption']} {document['alt']}" for document in documents.values()]
    for text in read:
        assert not re.search(r"\b(nan|None|inf|NaN)\b", words_of(text))


def test_trend_is_there_in_numbers_and_marks(client: httpx.Client) -> None:
    """It marks the alert, the change and the baseline."""
    document = figure(client, "trend")
    assert {"alert", "baseline", "threshold", "nominal", "baseline set"} <= names_in(document)
    (alert,) = (trace for trace in document["data"] if trace.get("name") == "alert")
    assert alert["y"][0] == pytest.approx(0.8 * 711, rel=0.05)
    (signs,) = (trace for trace in document["data"] if trace.get("name") == "baseline set")
    tests = client.get("/api/hangers/3/trend").json()["points"]
    (at,) = (each["time"] for each in tests if each["test"] == "t0")
    assert signs["x"] == [at.replace("T", " ").removesuffix("Z")]
    (span,) = document["layout"]["shapes"]
    assert "2026-05" in span["x0"]
    assert "-2" in span["label"]["text"]
    found = client.get("/api/hangers/3/trend").json()
    assert [point["test"] for point in found["points"]] == ["t0", "s1", "s2", "t1", "t2", "a/b ü?"]
    assert {event["kind"] for event in found["events"]} >= {"baseline", "alert"}
    assert found["changes"][0]["words"].startswith("sudden")
    since = client.get("/api/hangers/3/trend", params={"since": "2026-06-30T00:00:00Z"}).json()
    assert [point["test"] for point in since["points"]] == ["t2", "a/b ü?"]


def test_trend_comes_before_its_states(client: httpx.Client) -> None:
    AtTheSecondRequest.made.clear()
    first, second = (client.get("/api/hangers/3/figures/trend") for _ in range(2))
    states = client.get("/api/hangers/3/trend").json()["states"]
    assert first.headers["Retry-After"] == "2"
    assert "being worked out" in first.json()["message"]
    assert "Retry-After" not in second.headers
    assert "state, 90 % band" in names_in(second.json()) - names_in(first.json())
    tension = next(each for each in states if each["quantity"] == "tension")
    assert len(tension["times"]) == len(tension["q50"]) == 6
    assert tension["q05"][-1] < tension["q50"][-1] < tension["q95"][-1]


def test_tests_are_listed_newest_first_paged_and_linked(client: httpx.Client, page: str) -> None:
    first = client.get("/api/hangers/3/tests", params={"limit": 3}).json()
    before = {"limit": 3, "before": first["next_before"]}
    rest = client.get("/api/hangers/3/tests", params=before).json()
    assert [each["test"] for each in first["tests"]] == ["a/b ü?", "t2", "t1"]
    assert [each["test"] for each in rest["tests"]] == ["s2", "s1", "t0"]
    assert rest["next_before"] is None
    latest = first["tests"][0]
    for tension in (latest["tension_n"], latest["averaged"]["tension_n"]):
        assert tension["mean"] == pytest.approx(0.8 * 711e3, rel=0.05)
    assert '<a href="/hangers/3/tests/a%2Fb%20%C3%BC%3F">a/b ü?</a>' in page
    listed = client.get("/hangers/3/tests").text
    assert '<a href="/hangers/3/tests/t0">t0</a>' in listed
    oldest = client.get("/api/hangers/3/tests").json()["tests"][-1]["id"]
    older = client.get("/hangers/3/tests", params={"before": oldest}).text
    assert "There are no older tests." in words_of(older)


def test_a_hanger_without_tests_or_unknown_says_so(client: httpx.Client) -> None:
    found = client.get("/hangers/4")
    assert found.status_code == 200
    assert "Its tension is unknown without a test" in words_of(found.text)
    assert "data-figure" not in found.text
    assert client.get("/api/hangers/4/trend").json()["points"] == []
    assert client.get("/api/hangers/4/tests").json()["tests"] == []
    missing = client.get("/api/hangers/4/figures/trend")
    assert (missing.status_code, missing.json()["remedy"]) == (404, "Figures: none.")
    for address in ("/hangers/99", "/hangers/99/tests"):
        found = client.get(address)
        assert found.status_code == 404
        assert found.headers["content-type"].startswith("text/html")
        assert "known: 3, 4" in words_of(found.text)
    assert client.get("/api/hangers/99/trend").json()["message"]
    assert client.get("/api/hangers/3/figures/nothing").status_code == 404
