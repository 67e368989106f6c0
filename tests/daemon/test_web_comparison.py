"""The page that compares hangers: which are shown, their figure, and what cannot be shown."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest

from tests.helpers.flows import ingest
from tests.helpers.web_servers import served
from tests.helpers.workspaces import make_workspace, write_loss, write_test


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """Hanger 3 has lost tension, hanger 4 was tested once, the others never."""
    workspace = make_workspace(tmp_path_factory.mktemp("comparison"), hangers=range(3, 11))
    write_loss(workspace.spool, workspace)
    write_test(workspace.spool / "one.modes.json", workspace, hanger=4)
    ingest(workspace)
    with served(workspace) as site, site.client(Accept="text/html") as client:
        yield client


def test_chosen_hangers_share_an_axis(client: httpx.Client) -> None:
    page = client.get("/compare", params={"hanger": [4, 3]}).text
    assert "/api/compare/figure?hanger=3&amp;hanger=4" in page
    assert page.count(" checked") == 2
    figure = client.get("/api/compare/figure", params={"hanger": [4, 3]}).json()
    assert {"Hanger 3", "Hanger 4"} < {trace.get("name") for trace in figure["data"]}
    said = figure["alt"]
    assert "Hanger 3 -" in said
    assert "over 1 test" in said


def test_without_a_choice_the_hanger_that_needs_action_is_among_them(client: httpx.Client) -> None:
    page = client.get("/compare").text
    assert "hanger=3" in page
    assert page.count(" checked") == 3


def test_tests_before_the_chosen_day_are_left_out(client: httpx.Client) -> None:
    shown = {"hanger": 3, "since": "2100-01-01"}
    assert "None of these hangers was tested" in client.get("/compare", params=shown).text
    answer = client.get("/api/compare/figure", params=shown)
    assert answer.status_code == 404
    assert client.get("/compare", params={"since": "yesterday"}).status_code == 422


def test_what_cannot_be_compared_is_refused_with_a_remedy(client: httpx.Client) -> None:
    many = client.get("/compare", params={"hanger": list(range(3, 11))})
    assert many.status_code == 422
    assert "Choose up to 6" in many.text
    assert client.get("/compare", params={"hanger": 99}).status_code == 404
    never = client.get("/compare", params={"hanger": 7}).text
    assert "None of these hangers was tested" in never
