"""The page of one test, its document and its figures, with its raw file and without.

Problem: a clamped hanger is hit four times, one blow is double. The file's name is as odd as a
person can make it. Beside it a test came as its modes alone.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from html import unescape
from urllib.parse import unquote

import httpx
import numpy as np
import plotly.graph_objects as go  # type: ignore[import-untyped]
import pytest

from shm.read import write
from shm.simulate import HammerPlan, HangerState
from shm.store import Stage, Workspace
from shm.store.recordings import list_recordings
from shm.values import Channel
from shm_daemon.web.address import name_in
from shm_daemon.web.address import test_json as document_of
from shm_daemon.web.address import test_page as page_of
from shm_daemon.web.modal_test_view import FIGURES, FROM_RECORDS
from tests.helpers.flows import ingest
from tests.helpers.web_servers import Served, at_last, in_a_thread, served
from tests.helpers.workspaces import START, make_workspace, write_test
from tests.worlds.simulated.hammer import hammer_test

ODD = "odd #1 50% <b>Hänger?"
MODES_ALONE = "modes/alone"


def write_odd_recording(workspace: Workspace) -> float:
    """Leaves it in the spool; the largest force in it, in N."""
    hanger, rng = workspace.bridge.hanger(3), np.random.default_rng(5)
    plan = HammerPlan(hits=4, seconds_per_hit=6.0)
    state = HangerState(tension_n=690e3, damping_ratio=0.002)
    struck = hammer_test(
        hanger, state, plan, rng, time=START, temperature_c=12.5,
        disturbances=("double_hit",),
    )  # fmt: skip
    channels = tuple(_silent_after_the_second_hit(each, plan) for each in struck.channels)
    plain = workspace.folder / "plain.csv"
    write(replace(struck, hanger=3, channels=channels), plain)
    for path in workspace.folder.glob("plain.*"):
        path.rename(workspace.spool / f"{ODD}{path.suffix}")
    assert struck.force is not None
    return float(struck.force.values.max())


def _silent_after_the_second_hit(channel: Channel, plan: HammerPlan) -> Channel:
    """Sensors that record nothing of its ring-down."""
    values = channel.values.copy()
    if channel.quantity == "acceleration":
        samples_a_hit = len(values) / plan.hits
        values[int(1.15 * samples_a_hit) : int(1.9 * samples_a_hit)] = np.nan
    return replace(channel, values=values)


@dataclass(frozen=True)
class Site:
    workspace: Workspace
    served: Served
    client: httpx.Client
    odd: str
    """The name that the store has given the odd test."""
    largest_force_n: float


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """Sheets are worked out in a thread here: what the processes do is tested by themselves."""
    folder = tmp_path_factory.mktemp("web") / "bridge"
    workspace = make_workspace(folder, settings={"cross_check": "none"})
    largest_n = write_odd_recording(workspace)
    write_test(workspace.spool / "x.modes.json", workspace, day=9, name=MODES_ALONE)
    ingest(workspace)
    with workspace.store() as store:
        names = [stored.test.id for stored in store.tests.list_all(3)]
        assert {recording.stage for recording in list_recordings(store)} == {Stage.DONE}
    assert names[1:] == [MODES_ALONE]
    with in_a_thread(), served(workspace) as running, running.client() as client:
        yield Site(workspace, running, client, names[0], largest_n)


@pytest.fixture
def client(site: Site) -> httpx.Client:
    return site.client


def test_the_page_answers_before_the_raw_file_was_read(site: Site, client: httpx.Client) -> None:
    answer = client.get(page_of(3, site.odd))
    text = unescape(answer.text)
    assert answer.status_code == 200
    for said in ("Use with care", "double hit", "transverse", "12.5 °C", "Tension by this test",
                 "90 % interval"):  # fmt: skip
        assert said in text
    assert "<b>Hänger" not in answer.text
    assert not re.search(r"\b(nan|None)\b", text)
    response = client.get(f"{document_of(3, site.odd)}/figures/response")
    assert (response.status_code, response.headers["Retry-After"]) == (200, "2")
    assert "not at hand" in response.json()["caption"]
    history = client.get(f"{document_of(3, site.odd)}/figures/time_history")
    assert history.status_code == 202
    assert "identified once more" in history.json()["message"]


def test_every_figure_comes(site: Site, client: httpx.Client) -> None:
    page = client.get(page_of(3, site.odd)).text
    addresses = [unescape(found) for found in re.findall(r'data-figure="([^"]+)"', page)]
    assert [re.sub(r".*/figures/|\?.*", "", each) for each in addresses] == list(FIGURES)
    for address in addresses:
        answer = at_last(client, address)
        assert answer.status_code == 200, address
        document = json.loads(answer.text, parse_constant=pytest.fail)
        go.Figure(data=document["data"], layout=document["layout"])
        assert document["caption"]
        assert document["alt"]


def test_hits_and_time_history(site: Site, client: httpx.Client) -> None:
    answer = at_last(client, f"{document_of(3, site.odd)}/figures/time_history")
    traces = answer.json()["data"]
    force = next(trace for trace in traces if trace["mode"] == "lines" and trace["yaxis"] == "y")
    hits = client.get(f"{document_of(3, site.odd)}/hits").json()["hits"]
    drawn_n = [value for value in force["y"] if value is not None]
    assert max(drawn_n) == pytest.approx(site.largest_force_n, rel=1e-4)
    named = {trace["name"]: trace["x"] for trace in traces if "name" in trace}
    marks = {name: times_s for name, times_s in named.items() if "hit" in name}
    assert set(marks) == {"3 hits used", "1 hit dropped: not-a-number samples"}
    marked_s = [at_s for times_s in marks.values() for at_s in times_s]
    assert sorted(marked_s) == pytest.approx([hit["start_s"] for hit in hits], rel=1e-3)
    found = at_last(client, f"{document_of(3, site.odd)}/hits").json()
    assert len(found["hits"]) == 4
    assert [hit["reason"] for hit in found["hits"] if not hit["used"]] == ["not-a-number samples"]
    part = at_last(client, f"{page_of(3, site.odd)}?part=hits").text
    assert "no: not-a-number samples" in part
    assert "<html" not in part
    page = client.get(page_of(3, site.odd)).text
    assert "no: not-a-number samples" in page
    assert "data-fragment" not in page


def test_the_response_is_chosen_and_has_the_fit_over_it(site: Site, client: httpx.Client) -> None:
    names = client.get(document_of(3, site.odd)).json()["responses"]
    assert len(names) == 4
    titles = []
    for point, name in enumerate(names):
        answer = at_last(client, f"{document_of(3, site.odd)}/figures/response?point={point}")
        document = answer.json()
        title = str(document["layout"]["annotations"])
        assert name in title
        titles.append(title)
        curves = {trace.get("name"): trace for trace in document["data"]}
        assert {"measured", "fit of the modes", "transverse mode"} <= set(curves)
        peak = np.nanargmax(np.array(curves["measured"]["y"], float))
        nearest = np.min(
            np.abs(np.array(curves["transverse mode"]["x"]) - curves["measured"]["x"][peak])
        )
        assert nearest < 0.5 or "longitudinal" in title
    assert len(set(titles)) == 4
    page = client.get(page_of(3, site.odd), params={"response": 2}).text
    assert re.search(r'<option value="2" selected>', page)
    assert client.get(f"{document_of(3, site.odd)}/figures/response?point=99").status_code == 404


def test_the_document_tells_where_the_results_come_from(site: Site, client: httpx.Client) -> None:
    found = client.get(document_of(3, site.odd)).json()
    assert found["test"]["id"] == site.odd
    assert (found["verdict"], found["stage"], found["missing"]) == ("warning", "watched", "")
    assert (found["previous"], found["next"]) == (None, MODES_ALONE)
    with site.workspace.store() as store:
        stored = store.tests.named(3, site.odd)
        file = store.recordings.get(stored.recording_id).file
    assert found["file"]["sha256"] == file.sha256
    assert found["lineage"]["settings_sha256"] == stored.lineage.settings_sha256
    assert [step["stage"] for step in found["steps"]][-1] == "done"
    page = unescape(client.get(page_of(3, site.odd)).text)
    for said in (file.file_name, file.sha256, stored.lineage.input_sha256, "as they are now"):
        assert said in page
    assert f'href="{page_of(3, MODES_ALONE)}"' in page


def test_modes_that_came_as_such_say_why_there_is_no_more(client: httpx.Client, site: Site) -> None:
    page = unescape(client.get(page_of(3, MODES_ALONE)).text)
    assert "x.modes.json gave the modes of this test" in page
    assert "Not checked" in page
    assert "data-fragment" not in page
    found = client.get(document_of(3, MODES_ALONE)).json()
    assert found["figures"] == []
    assert found["responses"] == []
    for name in FIGURES:
        answer = client.get(f"{document_of(3, MODES_ALONE)}/figures/{name}")
        assert answer.status_code == 404
        assert answer.json()["message"]
    for path in (
        page_of(3, "none"), document_of(3, "none"), document_of(7, site.odd),
        f"{document_of(3, site.odd)}/figures/none",
    ):  # fmt: skip
        assert client.get(path).status_code == 404, path
    assert client.get(f"{page_of(3, site.odd)}?part=else").status_code == 422


def test_an_address_holds_any_name() -> None:
    for name in (ODD, "a/b", "ü?#&%2F", " ", ".", "..", "...", "a/"):
        path = httpx.URL(f"http://x{page_of(3, name)}").raw_path.decode()
        last = unquote(path.removeprefix("/hangers/3/tests/"))
        assert name_in(last) == name
        assert last not in (".", "..")  # a browser takes it for a way up
        assert path.count("/") == 4


def test_a_test_whose_raw_file_is_gone_shows_what_is_stored(site: Site) -> None:
    with site.workspace.store() as store:
        stored = store.tests.named(3, site.odd)
        file = store.recordings.get(stored.recording_id).file
    assert file.archived_as is not None
    kept = site.workspace.archive.folder / file.archived_as
    aside = kept.with_name("aside")
    kept.rename(aside)
    try:
        with site.served.client() as client:
            page = unescape(client.get(page_of(3, site.odd)).text)
            assert "was taken out of the archive" in page
            assert "shm archive fetch" in page
            shown = client.get(document_of(3, site.odd)).json()["figures"]
            assert shown == [name for name in FIGURES if FIGURES[name] not in FROM_RECORDS]
            for name in shown:
                answer = client.get(f"{document_of(3, site.odd)}/figures/{name}")
                assert (answer.status_code, answer.headers.get("Retry-After")) == (200, None)
            gone = client.get(f"{document_of(3, site.odd)}/figures/time_history")
            assert (gone.status_code, "archive" in gone.json()["message"]) == (404, True)
    finally:
        aside.rename(kept)
