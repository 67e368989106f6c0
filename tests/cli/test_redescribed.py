"""A description that changes after the baseline moves what later tests say: the report tells."""

from __future__ import annotations

import shutil
from dataclasses import fields, replace
from pathlib import Path

import pytest

from shm.pipeline.bridge_reporting import bridge_report
from shm.pipeline.lineage import (
    MOVES_NOTHING,
    redescribed,
)
from shm.pipeline.reporting import hanger_report
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.store import Workspace
from shm.values import Hanger, ResponsePoint
from tests.cli.conftest import Shm
from tests.helpers.taken_in import ingest_quickly
from tests.helpers.web_servers import served
from tests.helpers.workspaces import START, make_workspace, write_test


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 with two tests, the first of which is its baseline."""
    workspace = make_workspace(tmp_path_factory.mktemp("redescribed") / "bridge")
    for day in range(2):
        write_test(workspace.spool / f"t{day}.modes.json", workspace, day=day)
    ingest_quickly(workspace)
    return workspace


@pytest.fixture
def before(made: Workspace, tmp_path: Path) -> Workspace:
    """Return a copy of it."""
    return Workspace.open(shutil.copytree(made.folder, tmp_path / "bridge"))


def rewritten(workspace: Workspace, old: str, new: str) -> Workspace:
    path = workspace.folder / "bridge.toml"
    path.write_text(path.read_text().replace(old, new))
    return workspace.reopened()


@pytest.mark.slow
def test_a_baseline_of_a_discarded_test_is_said_first_until_there_is_a_new_one(
    shm: Shm, tmp_path: Path
) -> None:
    workspace = make_workspace(tmp_path / "discarded")
    for day in (0, 30, 60):
        write_test(workspace.spool / f"t{day}.modes.json", workspace, day=day)
    ingest_quickly(workspace)
    say = ("--workspace", workspace.folder)
    discard = ("ingest", "--discard", "t0", "--why", "loose sensor", "--who", "Ann")
    assert shm(*say, *discard).code == 0
    with workspace.store() as store:
        data = hanger_report(workspace, store, 3, START)
    assert data.discarded == ("t0",)
    first = " ".join(as_text(hanger_paper(data)).splitlines()[:8])
    assert "The baseline of hanger 3 was made from t0, discarded since" in first
    assert hanger_json(data)["discarded_of_baseline"] == ["t0"]
    anew = ("drift", "rebaseline", "--hanger", "3", "--since", f"{START:%Y-%m-%d}", "--why", "x")
    assert shm(*say, *anew).code == 0
    with workspace.store() as store:
        assert hanger_report(workspace, store, 3, START).discarded == ()


def test_a_changed_length_is_said_first_with_the_command_until_there_is_a_new_baseline(
    before: Workspace, shm: Shm
) -> None:
    with before.store() as store:
        assert hanger_report(before, store, 3, START).redescribed == ()
        workspace = rewritten(before, "length_m = 12.0", "length_m = 12.4")
        data = hanger_report(workspace, store, 3, START)
    assert data.redescribed == ("length_m from 12 to 12.4",)
    lines = as_text(hanger_paper(data)).splitlines()
    first = " ".join(lines[:8])
    assert "description of hanger 3 has changed since its baseline" in first
    assert "shm drift rebaseline --hanger 3" in first
    assert "has changed since its baseline" in as_html(hanger_paper(data))
    assert hanger_json(data)["redescribed"] == ["length_m from 12 to 12.4"]
    told = shm("--workspace", workspace.folder, "doctor").out
    assert "described otherwise since the baseline: 3" in told
    command = ("drift", "rebaseline", "--hanger", "3", "--since", f"{START:%Y-%m-%d}")
    assert shm("--workspace", workspace.folder, *command, "--why", "taped anew").code == 0
    with workspace.store() as store:
        assert hanger_report(workspace, store, 3, START).redescribed == ()


def test_a_field_that_an_older_version_did_not_know_has_its_default(before: Workspace) -> None:
    hanger = before.bridge.hanger(3)
    known = {"length_m", "elastic_modulus_pa", "area_m2", "second_moment_m4"}
    described = {
        each.name: getattr(hanger, each.name)  # numbers all
        for each in fields(Hanger)
        if each.name in known | {"mass_per_length_kg_m", "nominal_tension_n", "diameter_m"}
    }
    with before.store() as store:
        baseline = store.watch.baseline(3)
    assert baseline is not None
    assert redescribed(hanger, replace(baseline, described=described)) == ()
    older = {**described, "scatter": {"section": 0.01, "density": 0.003}}
    assert redescribed(hanger, replace(baseline, described=older)) == ()
    strand = replace(hanger, kind="strand", scatter=replace(hanger.scatter, section=0.02))
    assert redescribed(strand, replace(baseline, described=described)) == (
        "kind from rod to strand",
        "scatter.section from 0.01 to 0.02",
    )


@pytest.mark.parametrize("name", sorted({each.name for each in fields(Hanger)} - MOVES_NOTHING))
def test_every_other_field_of_a_hanger_is_compared(before: Workspace, name: str) -> None:
    """A field that is added to a hanger must be compared, or be said to move nothing."""
    with before.store() as store:
        baseline = store.watch.baseline(3)
    assert baseline is not None
    assert baseline.described is not None
    other = replace(baseline, described={**baseline.described, name: "another"})
    assert [each.split()[0] for each in redescribed(before.bridge.hanger(3), other)] == [name]


def test_page_and_bridge_report_describe_the_bar(made: Workspace, tmp_path: Path) -> None:
    workspace = Workspace.open(shutil.copytree(made.folder, tmp_path / "bridge"))
    path = workspace.folder / "bridge.toml"
    text = path.read_text().replace("length_m = 12.0", 'measured_by = "Ann"\nlength_m = 12.0')
    first = text[text.index("[[hanger]]") : text.index("[settings]")]
    stream = (
        '[[stream]]\nname = "h4"\nhanger = 4\nsampling_rate_hz = 200\n'
        '[[stream.channel]]\nname = "acc_1"\nplane = "transverse"\nx_m = 3.0\n\n'
    )
    more = f"{first.replace('id = 3', 'id = 4')}{stream}"
    path.write_text(text.replace("[settings]", f"{more}[settings]"))
    workspace = workspace.reopened()
    with workspace.store() as store:
        tested, untested = bridge_report(workspace, store, START).hangers
    assert (tested.bar.measured_by, tested.bar.sensors) == ("Ann", ())  # its modes have no shapes
    assert untested.bar.sensors == (ResponsePoint("acc_1", "transverse", 3.0),)
    with served(workspace) as site, site.client() as client:
        for number in (3, 4):
            page = client.get(f"/hangers/{number}", headers={"Accept": "text/html"}).text
            table = page[page.index("The bar as described") :].split("</table>")[0]
            assert "diameter 130 mm" in table
            assert "Ann" in table


def test_the_page_of_the_hanger_says_so_first(before: Workspace) -> None:
    workspace = rewritten(before, "length_m = 12.0", "length_m = 12.4")
    with served(workspace) as site, site.client() as client:
        page = client.get("/hangers/3", headers={"Accept": "text/html"}).text
    start = page.index("<main")
    assert 0 < page.index("has changed since its baseline") - start < 1500
