"""Verbs on a workspace: init, status, report, alerts, export, note, manual."""

from __future__ import annotations

import csv
import re
import shutil
import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import xarray
from PIL import Image

from shm.pipeline import utc_now
from shm.pipeline.reporting import hanger_report
from shm.report.as_text import as_brief_text
from shm.report.hanger_report import hanger_paper
from shm.report.states import period_since
from shm.store import Workspace
from tests.cli.conftest import Ended, Shm
from tests.helpers.pdf_words import Pdf


def test_init_makes_a_workspace_that_status_can_read(shm: Shm, tmp_path: Path) -> None:
    folder = tmp_path / "arch"
    assert shm("init", folder).code == 0
    ended = shm("--workspace", folder, "status", "--json")
    assert ended.code == 0
    assert ended.document["recordings"]["done"] == 0


@pytest.mark.parametrize("name", ['Arch "of" Döm', "back\\slash \\1", "plain"])
def test_init_writes_bridge_name(shm: Shm, tmp_path: Path, name: str) -> None:
    shm("init", tmp_path / "a")
    shm("init", tmp_path / "b", "--bridge", name)
    plain, named = (tomllib.loads((tmp_path / n / "bridge.toml").read_text()) for n in "ab")
    assert named["bridge"]["name"] == name
    assert {**named, "bridge": None} == {**plain, "bridge": None}


def test_status_counts_tests_and_alerts_of_each_hanger(on_bridge: Shm) -> None:
    document = on_bridge.json("status")
    assert document["recordings"]["done"] == 3
    # What t2 found answers the notice that t1 is to be repeated.
    assert (document["alerts"], document["open_alerts"]) == (2, 1)
    three, four = document["hangers"]
    assert (three["hanger"], three["tests"], three["model"]) == (3, 3, "beam1")
    assert (three["latest_test"], three["open_alerts"]) == ("2026-06-30T10:00:00Z", 1)
    assert three["baseline_since"] is not None
    assert (four["tests"], four["latest_test"], four["open_alerts"]) == (0, None, 0)
    assert "Test bridge: recordings: 3 done" in on_bridge("status").out


def test_report_comes_in_the_form_of_its_format_or_file(on_bridge: Shm, tmp_path: Path) -> None:
    call = "report --hanger 3"
    assert on_bridge(call).out.startswith("Hanger 3, Test bridge: Alert")
    assert on_bridge(f"{call} --format html").out.lstrip().startswith("<!doctype html>")
    document = on_bridge.json(call)
    assert document["schema"] == "shm.report/1"
    assert [row["test"] for row in document["trend"]] == ["t0", "t1", "t2"]
    assert document["posterior"]["tests"] == ["t2"]
    as_json = on_bridge(f"{call} --format json").document
    assert document == {**as_json, "generated_at": document["generated_at"]}
    for name, start in (("r.html", "<!doctype"), ("r.json", "{"), ("r.txt", "Hanger 3")):
        ended = on_bridge.done(f"{call} --out {tmp_path / name}")
        assert ended.out == ""
        assert str(tmp_path / name) in ended.err
        assert (tmp_path / name).read_text().lstrip().startswith(start)


def test_alerts_are_listed_with_what_the_hooks_got(shm: Shm, bridge: Workspace) -> None:
    call = ("--workspace", bridge.folder, "alerts")
    notice, row = shm(*call, "--json").document["alerts"]
    assert (notice["alert"]["test"], notice["alert"]["kinds"]) == ("t1", ["repeat the test"])
    assert row["alert"]["schema"] == "shm.alert/1"
    assert (row["alert"]["test"], row["deliveries"]) == ("t2", [])
    assert "tension fell by" in shm(*call, "--hanger", 3).out.replace("\n", " ")
    assert shm(*call, "--hanger", 4).out.strip() == "No alert has been raised."


def test_export_csv_and_npz_agree(shm: Shm, bridge: Workspace, tmp_path: Path) -> None:
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


def test_export_for_arviz_adds_likelihood(shm: Shm, bridge: Workspace, tmp_path: Path) -> None:
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


def test_the_suffix_pdf_gives_a_pdf_with_origin(
    shm: Shm, bridge: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "r.PDF"
    ended = shm.at(bridge)("report", "--hanger", 3, "--out", out)
    assert (ended.code, ended.out) == (0, "")
    told = Pdf.parse(out.read_bytes()).words
    assert "Hanger 3 ● Alert" in told
    assert "t2.modes.json" in told
    assert "SHA-256 of that file" in told
    assert "band_low_hz" not in told  # the settings are an appendix of the page
    monkeypatch.setattr("shm_cli.report.on_a_terminal", lambda: True)
    ended = shm.at(bridge)("report", "--hanger", 3, "--format", "pdf")
    assert ended.code == 2
    assert "--out FILE.pdf" in ended.err


def test_a_period_keeps_what_lies_in_it(shm: Shm, bridge: Workspace) -> None:
    call = ("--workspace", bridge.folder, "report", "--hanger", 3, "--json")
    whole = shm(*call).document
    second = whole["trend"][1]["time"]
    document = shm(*call, "--since", second).document
    assert [row["test"] for row in document["trend"]] == ["t1", "t2"]
    assert document["period"]["since"] == second
    assert "In the period" in document["summary"]
    assert document["posterior"] == whole["posterior"]


@pytest.fixture
def note(on_empty: Shm) -> Callable[..., Ended]:
    return partial(on_empty, "note")


def test_note_is_written_and_listed(note: Callable[..., Ended], tmp_path: Path) -> None:
    assert "No note" in note("list").out
    photo = tmp_path / "pin.png"
    Image.new("RGB", (4, 4)).save(photo)
    told = ("--hanger", 3, "--kind", "repair", "--at", "2026-05-01", "--photo", photo)
    made = note("add", "new pin", *told, "--who", "anna", "--json").document
    assert (made["id"], made["has_photo"], made["at"][:10]) == (1, True, "2026-05-01")
    assert note("add", "storm", "--bridge").code == 0
    listed = note("list", "--hanger", 3, "--json").document["notes"]
    assert [each["text"] for each in listed] == ["storm", "new pin"]
    assert "new pin" in note("list").out


def test_brief_report_is_page_one_of_the_full(on_bridge: Shm, bridge: Workspace) -> None:
    for since, period in (
        ("", None),
        (" --since 2000-01-01", period_since("2000-01-01", utc_now())),
    ):
        with bridge.store() as store:
            paper = hanger_paper(hanger_report(bridge, store, 3, utc_now(), period))
        told = " ".join(as_brief_text(paper).split())
        assert on_bridge.told(f"report --hanger 3{since}") == told


def test_full_report_letters_its_appendices(shm: Shm, bridge: Workspace) -> None:
    told = shm.at(bridge).done("report", "--hanger", 3, "--full").out
    letters = re.findall(r"^Appendix ([A-Z]): ", told, re.MULTILINE)
    assert len(letters) >= 2
    assert "".join(letters) == "ABCDEF"[: len(letters)]
