"""One hanger, one number: page, report in every format, status, alert and hook agree.

A small bridge of which one hanger lost a twelfth of its tension, made by the real flow. The same
quantity is the same number on every face; another one has another label.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from click.testing import CliRunner

from shm.documents import alert_document, dump
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import bridge_report, hanger_summaries
from shm.pipeline.courier import message_of
from shm.pipeline.reporting import hanger_report
from shm.report.as_html import as_html
from shm.report.as_pdf import as_pdf
from shm.report.as_text import as_brief_text, as_text
from shm.report.bridge_report import bridge_json
from shm.report.formatting import Interval, with_half
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.report.hanger_summary import BASELINE_AND_CHANGE, HangerSummary
from shm.store import Store, Workspace
from shm.values.rounding import force_unit, rounded_percent
from shm_cli.main import cli
from tests.helpers.flows import ingest
from tests.helpers.painting import paint_blank
from tests.helpers.pdf_words import Pdf
from tests.helpers.web_servers import words_of
from tests.helpers.workspaces import SLOW_LOSS, make_workspace, write_test

_KILONEWTONS = re.compile(r"(\d+(?:\.\d+)? ± \d+(?:\.\d+)? kN)")
_PERCENTS = re.compile(r"([+-]\d+(?:\.\d+)? ± \d+(?:\.\d+)? %)")


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 has lost a twelfth of its tension, as its last test shows; hanger 4 stays."""
    folder = tmp_path_factory.mktemp("agree") / "bridge"
    workspace = make_workspace(folder, hangers=(3, 4), hooks={"mail": ["true"]})
    for hanger, history in ((3, SLOW_LOSS), (4, (1.0, 1.001, 0.999, 1.0))):
        for place, tension in enumerate(history):
            path = workspace.spool / f"h{hanger}-{place}.modes.json"
            write_test(path, workspace, hanger=hanger, day=30 * (place - 4), tension=tension)
    ingest(workspace)
    return workspace


@pytest.fixture(scope="module")
def store(bridge: Workspace) -> Iterator[Store]:
    with bridge.store() as store:
        yield store


@pytest.fixture(scope="module", params=[3, 4])
def now(request: pytest.FixtureRequest, bridge: Workspace, store: Store) -> HangerSummary:
    (found,) = hanger_summaries(bridge, store, utc_now(), [bridge.bridge.hanger(request.param)])
    return found


@pytest.fixture(scope="module")
def faces(
    now: HangerSummary, bridge: Workspace, store: Store, client: httpx.Client
) -> dict[str, str]:
    """Return the words of every face that a person reads, of one hanger."""
    number = now.hanger.id
    paper = hanger_paper(hanger_report(bridge, store, number, utc_now()))
    with pytest.MonkeyPatch.context() as patch:
        paint_blank(patch)
        pdf, page = as_pdf(paper), as_html(paper)
    found = {
        "page": words_of(client.get(f"/hangers/{number}").text),
        "brief": as_brief_text(paper),
        "text": as_text(paper),
        "html": words_of(page),
        "pdf": Pdf.parse(pdf).words,
    }
    return {face: " ".join(words.split()) for face, words in found.items()}


def _status(bridge: Workspace, *arguments: str) -> str:
    told = CliRunner().invoke(cli, ["--workspace", str(bridge.folder), "status", *arguments])
    assert told.exit_code == 0, told.output
    return told.stdout


def documents(
    now: HangerSummary, bridge: Workspace, store: Store, client: httpx.Client
) -> dict[str, dict[str, Any]]:
    """Return the hanger in every face for a program."""
    number, at = now.hanger.id, utc_now()
    every = json.loads(dump(bridge_json(bridge_report(bridge, store, at))))["hangers"]
    return {
        "report": json.loads(dump(hanger_json(hanger_report(bridge, store, number, at)))),
        "bridge report": next(each for each in every if each["hanger"] == number),
        "api": client.get(f"/api/hangers/{number}").json(),
        "status": next(
            each
            for each in json.loads(_status(bridge, "--json"))["hangers"]
            if each["hanger"] == number
        ),
    }


def test_the_loss_is_seen_and_the_other_hanger_is_quiet(bridge: Workspace, store: Store) -> None:
    lost, quiet = hanger_summaries(bridge, store, utc_now())
    assert lost.basis == BASELINE_AND_CHANGE
    assert lost.is_found
    assert lost.tension_n is not None
    assert lost.baseline_n is not None
    assert lost.change is not None
    assert lost.tension_n.mean == pytest.approx(lost.baseline_n.mean * (1 + lost.change.mean))
    assert lost.change.mean == pytest.approx(-0.08, abs=0.015)
    assert not quiet.is_found


def test_every_document_has_the_same_tension_and_change(
    now: HangerSummary, bridge: Workspace, store: Store, client: httpx.Client
) -> None:
    expected = json.loads(dump(now.document))
    for face, document in documents(now, bridge, store, client).items():
        for key in ("averaged", "basis", "change", "by_latest_test"):
            assert document[key] == expected[key], (face, key)
    glance = next(
        each
        for each in client.get("/api/bridge").json()["hangers"]
        if each["hanger"] == now.hanger.id
    )
    assert now.tension is not None
    assert now.change is not None
    assert glance["tension_n"]["mean"] == now.tension.tension_n.mean
    assert glance["shift"]["mean"] == pytest.approx(now.change.mean)


def test_every_face_says_one_tension(now: HangerSummary, faces: dict[str, str]) -> None:
    assert now.tension_n is not None
    assert now.latest is not None
    unit = force_unit(now.tension_n.mean)
    headline = with_half(now.tension_n, unit)
    alone = with_half(Interval.of_averaged(now.latest.tension), unit)
    before = now.baseline_n and with_half(now.baseline_n, unit)
    for face, words in faces.items():
        assert headline in words, face
        for place in _KILONEWTONS.finditer(words):
            label = words[max(0, place.start() - 60) : place.start()].lower()
            if place[1] == headline:
                continue
            assert place[1] in (alone, before), (face, place[1])
            assert ("alone" if place[1] == alone else "baseline") in label, (face, label)


def test_every_face_says_one_change(now: HangerSummary, faces: dict[str, str]) -> None:
    assert now.change is not None
    change = rounded_percent(now.change.mean, now.change.width / 2, "+")
    for face, words in faces.items():
        found = set(_PERCENTS.findall(words))
        assert change in found, face
        for other in found - {change}:
            label = words[: words.index(other)][-60:]
            assert "nominal" in label or "per K" in words[words.index(other) :][:40], (face, other)


def test_status_and_home_agree(bridge: Workspace, store: Store, client: httpx.Client) -> None:
    told, home = " ".join(_status(bridge).split()), words_of(client.get("/").text)
    for now in hanger_summaries(bridge, store, utc_now()):
        assert now.tension_n is not None
        number = with_half(now.tension_n, force_unit(now.tension_n.mean)).removesuffix(" kN")
        assert number in told
        assert number in " ".join(home.split())
        assert now.of_nominal_words.removesuffix(" %") in " ".join(home.split())


def test_alert_and_hook_say_the_tension_of_the_page(bridge: Workspace, store: Store) -> None:
    (stored,) = store.alerts.list_all(3)
    (now,) = hanger_summaries(bridge, store, utc_now(), [bridge.bridge.hanger(3)])
    assert now.latest is not None
    assert stored.alert.test == now.latest.name
    assert stored.alert.tension is not None
    assert now.tension is not None
    assert now.tension_n is not None
    assert now.baseline_n is not None
    assert stored.alert.tension.tension_n == now.tension.tension_n
    unit = force_unit(now.tension_n.mean, now.baseline_n.mean)
    hook = alert_document(message_of(store.alerts.list_deliveries()))
    assert hook["tension"] == alert_document(stored.alert)["tension"]
    for message in (stored.alert.message, str(hook["message"])):
        assert f"The tension is now {with_half(now.tension_n, unit)}." in message
        assert f"At the baseline it was {with_half(now.baseline_n, unit)}." in message
        assert message.startswith(now.message.lead.state)


def test_a_hanger_without_a_test_has_no_number(tmp_path: Path) -> None:
    empty = make_workspace(tmp_path / "empty", hangers=(3,))
    with empty.store() as nothing:
        (now,) = hanger_summaries(empty, nothing, utc_now())
    assert (now.tension, now.change, now.basis) == (None, None, "")
    assert now.document["averaged"] is None
