"""A control hanger, from its description to its chart and the campaigns that it puts in doubt."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from shm.bridge import load_bridge
from shm.documents import dump
from shm.errors import BadInput
from shm.modes_document import modes_document
from shm.pipeline.controls import control_charts
from shm.store import Workspace
from shm.store.posteriors import list_trend
from shm.store.watch import find_latest_watches
from shm_cli.main import run
from tests.helpers.taken_in import ingest_quickly
from tests.helpers.workspaces import make_workspace, modelled_test, put, write_test

CONTROL = 90
MONTH = 30.0
DOUBT = "its campaign is in doubt, for control hanger 90 was out of its limits."
LOGGER_FAST = (1 / 1.035) ** 2  # what a clock 3.5 % fast makes of every tension


def describe_control(workspace: Workspace, *lines: str) -> Path:
    """Describe a bar like the hangers, whose tension a load cell knows to half a percent."""
    config = workspace.folder / "bridge.toml"
    bar = config.read_text().split("[[hanger]]")[1].split("[settings]")[0].split("[[")[0]
    bar = bar.replace("id = 3", f"id = {CONTROL}")
    stated = lines or (
        "control = true", "known_tension_n = 711e3", "known_tension_sd_n = 3.6e3"
    )  # fmt: skip
    config.write_text("\n".join((config.read_text(), f"[[hanger]]{bar}", *stated, "")))
    return config


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Campaigns of two hangers and the control; in the fourth the logger's clock runs fast."""
    folder = tmp_path_factory.mktemp("control") / "bridge"
    made = make_workspace(folder, hangers=(3, 4), hooks={"mail": ["true"]})
    describe_control(made)
    made = Workspace.open(made.folder)
    for campaign in range(4):
        factor = LOGGER_FAST if campaign == 3 else 1.0
        for hanger in (3, 4, CONTROL):
            path = made.spool / f"h{hanger}-{campaign}.modes.json"
            day = MONTH * (campaign - 3) + (0.3 if hanger == CONTROL else 0.1)
            write_test(path, made, hanger=hanger, day=day, tension=factor)
    ingest_quickly(made)
    return made


@pytest.fixture
def shown(
    workspace: Workspace, capsys: pytest.CaptureFixture[str]
) -> Callable[..., dict[str, Any]]:
    def run_verb(*arguments: str) -> dict[str, Any]:
        assert run(["--workspace", str(workspace.folder), *arguments, "--json"]) == 0
        document: dict[str, Any] = json.loads(capsys.readouterr().out)
        return document

    return run_verb


def test_control_out_doubts_campaign(shown: Callable[..., dict[str, Any]]) -> None:
    status = shown("status")

    assert [row["hanger"] for row in status["hangers"]] == [3, 4]
    for row in status["hangers"]:
        assert DOUBT in row["warnings"][0]
        assert row["status"] in ("check", "alert", "watch")
        assert DOUBT in f"{row['state']} {row['reason']}"
    (control,) = status["controls"]
    assert [point["is_out"] for point in control["points"]] == [False] * 3 + [True]
    assert control["urgency"] == "week"
    assert control["points"][-1]["deviation"] == pytest.approx(LOGGER_FAST - 1, abs=0.005)


def test_control_never_watched(workspace: Workspace) -> None:
    with workspace.store() as store:
        alerts = [stored.alert for stored in store.alerts.list_all()]
        assert not store.watch.list_all(CONTROL)
        assert CONTROL not in find_latest_watches(store)
    assert alerts  # the hangers are not silenced
    assert all(alert.hanger != CONTROL for alert in alerts)
    assert any(DOUBT in alert.message.partition(" Details: ")[0] for alert in alerts)


def test_control_report_has_chart(
    workspace: Workspace, shown: Callable[..., dict[str, Any]], tmp_path: Path
) -> None:
    document = shown("report", "--hanger", str(CONTROL))
    assert document["control"] == shown("status")["controls"][0]
    assert document["message"]["status"] == "check"
    assert shown("report", "--bridge")["controls"][0]["hanger"] == CONTROL
    for of in (("--hanger", str(CONTROL)), ("--bridge",)):
        page = tmp_path / "report.html"
        at = ["--workspace", str(workspace.folder)]
        assert run([*at, "report", *of, "--out", str(page)]) == 0
        assert "out of its limits" in page.read_text()
        assert 'id="control-title"' in page.read_text()


def test_control_reading_is_the_known(tmp_path: Path) -> None:
    made = make_workspace(tmp_path / "bridge", hangers=(3,))
    describe_control(made)
    made = Workspace.open(made.folder)
    described = replace(made.bridge.hangers[0], id=CONTROL)
    test = modelled_test("c1", described, 0.0, 0.9)
    read = replace(test, tension_read_n=0.9 * 711e3, tension_read_sd_n=3e3)
    put(made.spool / "c1.modes.json", dump(modes_document([read])))
    ingest_quickly(made)

    with made.store() as store:
        (chart,) = control_charts(made, store)
        averaged = list_trend(store, made.bridge.controls[0])[0].averaged

    (point,) = chart.points
    assert point.known_n == pytest.approx(0.9 * 711e3)
    assert not point.is_out
    # What was read is no part of the inference: else the tension would be as sure as the cell.
    assert averaged.tension_n.sd > 1.5 * 3e3


@pytest.mark.parametrize(
    ("lines", "wrong"),
    [
        (("control = true", "known_tension_n = 711e3"), "known_tension_sd_n"),
        (("control = true", "known_tension_n = -1", "known_tension_sd_n = 1"), "known_tension_n"),
        (('control = "yes"',), "control"),
        (("known_tension_n = 711e3",), "control hanger alone"),
    ],
)
def test_bad_control_refused(tmp_path: Path, lines: tuple[str, ...], wrong: str) -> None:
    config = describe_control(make_workspace(tmp_path / "bridge"), *lines)

    with pytest.raises(BadInput, match=wrong) as refused:
        load_bridge(config)

    assert refused.value.remedy
    assert "id 90" in str(refused.value)
