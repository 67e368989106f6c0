"""The page that compares hangers: which are shown, their figure, and what cannot be shown."""

from __future__ import annotations

import httpx
import pytest

from shm.store import Workspace
from tests.helpers.taken_in import ingest_quickly
from tests.helpers.workspaces import make_workspace, write_loss, write_test


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 has lost tension, hanger 4 was tested once, the others never."""
    folder = tmp_path_factory.mktemp("comparison") / "bridge"
    workspace = make_workspace(folder, hangers=range(3, 11))
    write_loss(workspace.spool, workspace)
    write_test(workspace.spool / "one.modes.json", workspace, hanger=4)
    ingest_quickly(workspace)
    return workspace


def test_chosen_hangers_share_an_axis_or_are_refused(client: httpx.Client) -> None:
    """Without a choice the one that needs action is among them; a day excludes what was before."""
    page = client.get("/compare", params={"hanger": [4, 3]}).text
    assert "/api/compare/figure?hanger=3&amp;hanger=4" in page
    assert page.count(" checked") == 2
    figure = client.get("/api/compare/figure", params={"hanger": [4, 3]}).json()
    assert {"Hanger 3", "Hanger 4"} < {trace.get("name") for trace in figure["data"]}
    said = figure["alt"]
    assert "Hanger 3 -" in said
    assert "over 1 test" in said
    page = client.get("/compare").text
    assert "hanger=3" in page
    assert page.count(" checked") == 3
    many = client.get("/compare", params={"hanger": list(range(3, 11))})
    assert many.status_code == 422
    assert "Choose up to 6" in many.text
    assert client.get("/compare", params={"hanger": 99}).status_code == 404
    never = client.get("/compare", params={"hanger": 7}).text
    assert "None of these hangers was tested" in never
    shown = {"hanger": 3, "since": "2100-01-01"}
    assert "None of these hangers was tested" in client.get("/compare", params=shown).text
    answer = client.get("/api/compare/figure", params=shown)
    assert answer.status_code == 404
    assert client.get("/compare", params={"since": "yesterday"}).status_code == 422
