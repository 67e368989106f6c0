"""Verbs on a workspace: init, status, report, drift, alerts, export, db."""

from __future__ import annotations

import csv
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
import xarray

from shm.store import Workspace
from tests.cli.conftest import Shm


def test_init_makes_a_workspace_that_status_can_read(shm: Shm, tmp_path: Path) -> None:
    folder = tmp_path / "arch"
    assert shm("init", folder).code == 0
    ended = shm("--workspace", folder, "status", "--json")
    assert ended.code == 0
    assert ended.document["recordings"]["done"] == 0


@pytest.mark.parametrize("name", ['Arch "of" Döm', "back\\slash \\1", "plain"])
def test_init_writes_the_name_of_the_bridge_and_leaves_the_rest(
    shm: Shm, tmp_path: Path, name: str
) -> None:
    shm("init", tmp_path / "a")
    shm("init", tmp_path / "b", "--bridge", name)
    plain, named = (tomllib.loads((tmp_path / n / "bridge.toml").read_text()) for n in "ab")
    assert named["bridge"]["name"] == name
    assert {**named, "bridge": None} == {**plain, "bridge": None}


def test_a_workspace_is_not_made_twice(shm: Shm, empty: Workspace) -> None:
    ended = shm("init", empty.folder)
    assert ended.code == 2
    assert "workspace already" in ended.err


def test_status_counts_tests_and_alerts_of_each_hanger(shm: Shm, bridge: Workspace) -> None:
    document = shm("--workspace", bridge.folder, "status", "--json").document
    assert document["recordings"]["done"] == 3
    assert document["alerts"] == 2  # that t1 is to be repeated, and what t2 found
    three, four = document["hangers"]
    assert (three["hanger"], three["tests"], three["model"]) == (3, 3, "beam1")
    assert three["latest_test"] == "2026-06-30T10:00:00Z"
    assert (four["tests"], four["latest_test"]) == (0, None)
    told = shm("--workspace", bridge.folder, "status").out
    assert "Test bridge: recordings: 3 done" in told


def test_the_report_comes_as_text_html_or_json(shm: Shm, bridge: Workspace) -> None:
    call = ("--workspace", bridge.folder, "report", "--hanger", 3)
    assert shm(*call).out.startswith("Hanger 3, Test bridge: Alert")
    assert shm(*call, "--format", "html").out.lstrip().startswith("<!doctype html>")
    document = shm(*call, "--json").document
    assert document == {
        **shm(*call, "--format", "json").document,
        "generated_at": document["generated_at"],
    }
    assert document["schema"] == "shm.report/1"
    assert [row["test"] for row in document["trend"]] == ["t0", "t1", "t2"]
    assert document["posterior"]["tests"] == ["t2"]


@pytest.mark.parametrize(
    ("name", "start"), [("r.html", "<!doctype"), ("r.json", "{"), ("r.txt", "Hanger 3")]
)
def test_the_suffix_of_the_file_chooses_the_form_of_the_report(
    shm: Shm, bridge: Workspace, tmp_path: Path, name: str, start: str
) -> None:
    out = tmp_path / name
    ended = shm("--workspace", bridge.folder, "report", "--hanger", 3, "--out", out)
    assert (ended.code, ended.out) == (0, "")
    assert str(out) in ended.err
    assert out.read_text().lstrip().startswith(start)


@pytest.mark.parametrize("verb", ["report", "drift", "alerts", "export"])
def test_a_hanger_that_the_bridge_lacks_is_not_there(
    shm: Shm, bridge: Workspace, tmp_path: Path, verb: str
) -> None:
    out = ["--out", tmp_path / "x.csv"] if verb == "export" else []
    ended = shm("--workspace", bridge.folder, verb, "--hanger", 9, *out)
    assert ended.code == 4
    assert "known: 3, 4" in ended.err


@pytest.mark.parametrize("verb", ["report", "drift", "export"])
def test_a_hanger_without_tests_has_nothing_yet(
    shm: Shm, bridge: Workspace, tmp_path: Path, verb: str
) -> None:
    out = ["--out", tmp_path / "x.csv"] if verb == "export" else []
    assert shm("--workspace", bridge.folder, verb, "--hanger", 4, *out).code == 4


def test_alerts_are_listed_with_what_the_hooks_got(shm: Shm, bridge: Workspace) -> None:
    call = ("--workspace", bridge.folder, "alerts")
    notice, row = shm(*call, "--json").document["alerts"]
    assert (notice["alert"]["test"], notice["alert"]["kinds"]) == ("t1", ["repeat the test"])
    assert row["alert"]["schema"] == "shm.alert/1"
    assert (row["alert"]["test"], row["deliveries"]) == ("t2", [])
    assert "tension fell by" in shm(*call, "--hanger", 3).out.replace("\n", " ")
    assert shm(*call, "--hanger", 4).out.strip() == "No alert has been raised."


def test_posterior_samples_are_exported_alike_as_csv_and_npz(
    shm: Shm, bridge: Workspace, tmp_path: Path
) -> None:
    call = ("--workspace", bridge.folder, "export", "--hanger", 3, "--test", "t0", "--out")
    assert shm(*call, tmp_path / "s.csv").code == 0
    assert shm(*call, tmp_path / "s.npz").code == 0
    with (tmp_path / "s.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    table = np.array(rows, dtype=float)
    of_the_bar = ["section", "density", "modulus", "inclination", "sag_shape"]
    assert head == ["theta_F", "theta_L", *of_the_bar, "sigma", "tension_n", "log_likelihood"]
    with np.load(tmp_path / "s.npz") as columns:
        for name, column in zip(head, table.T, strict=True):
            assert np.array_equal(columns[name], column)
    tension_n = table[:, head.index("tension_n")]
    assert tension_n == pytest.approx(table[:, 0] * 711e3)


def test_an_export_for_arviz_adds_the_likelihood_unless_the_description_has_changed(
    shm: Shm, bridge: Workspace, tmp_path: Path
) -> None:
    changed = tmp_path / "bridge"
    shutil.copytree(bridge.folder, changed)
    described = (changed / "bridge.toml").read_text()
    (changed / "bridge.toml").write_text(described.replace("length_m = 12.0", "length_m = 11.0"))
    call = ("export", "--hanger", 3, "--format", "netcdf", "--json", "--out", tmp_path / "s.dat")
    for folder, group, said in (
        (bridge.folder, {"log_likelihood", "posterior_predictive"}, ""),
        (changed, set(), "Without the likelihood of each measurement"),
    ):
        ended = shm("--workspace", folder, *call)
        assert (ended.code, said in ended.err) == (0, True)
        with xarray.open_datatree(tmp_path / "s.dat", engine="h5netcdf") as tree:
            assert tree["posterior"].sizes["draw"] == ended.document["samples"]
            assert set(tree.children) & {"log_likelihood", "posterior_predictive"} == group


def test_an_export_of_an_unknown_kind_is_a_usage_error(
    shm: Shm, bridge: Workspace, tmp_path: Path
) -> None:
    ended = shm("--workspace", bridge.folder, "export", "--hanger", 3, "--out", tmp_path / "s.xls")
    assert ended.code == 2
    assert ".csv, .nc, .json or .npz" in ended.err


def test_a_workspace_without_a_store_says_so(shm: Shm, empty: Workspace) -> None:
    empty.database.unlink()
    assert shm("--workspace", empty.folder, "db", "check").code == 4


def test_a_wrong_description_names_the_key(shm: Shm, empty: Workspace) -> None:
    path = empty.folder / "bridge.toml"
    path.write_text(path.read_text().replace("length_m = 12.0", "length_m = -1"))
    ended = shm("--workspace", empty.folder, "status", "--json")
    assert ended.code == 3
    assert ended.document["schema"] == "shm.error/1"
    assert "length_m = -1" in ended.document["message"]
    assert ended.document["line"] == 7
    assert "length_m = -1" in ended.err


def test_manual_page(shm: Shm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "manual" / "index.html"
    monkeypatch.setattr("shm_cli.installation.manual", lambda: page)
    missing = shm("manual")
    assert missing.code == 4
    assert "make wheel" in missing.err
    page.parent.mkdir()
    page.touch()
    assert shm("manual").out == f"{page}\n"
    assert shm("manual", "--json").document == {"schema": "shm.manual/1", "page": str(page)}
