"""The dashboard beside a structure without a model: its alerts are shown, no page breaks."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.store import Workspace
from tests.helpers.flows import ingest
from tests.helpers.structures import DECK, LOST_FROM, with_a_deck, write_week
from tests.helpers.web_servers import served
from tests.helpers.workspaces import make_workspace


@pytest.mark.slow
def test_alerts_of_a_deck_are_listed_and_no_page_breaks(tmp_path: Path) -> None:
    made = make_workspace(tmp_path / "bridge", settings={"baseline_tests": 3})
    workspace: Workspace = with_a_deck(made)
    for week in range(LOST_FROM + 4):
        write_week(workspace, week)
    ingest(workspace)

    with served(workspace) as site, site.client() as client:
        for page in ("/", "/alerts", "/metrics", "/api/hangers", "/api/alerts"):
            answer = client.get(page)
            assert answer.status_code == 200, (page, answer.text[:300])
        assert "of Deck ha" in client.get("/alerts").text
        assert client.get(f"/hangers/{DECK}").status_code == 404
