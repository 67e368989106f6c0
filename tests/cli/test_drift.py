"""`shm drift bridge`, and what a baseline rests on: doubts, changed descriptions, discards."""

from __future__ import annotations

import shutil
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from shm.documents import dump
from shm.modes_document import modes_document
from shm.pipeline.bridge_reporting import bridge_report
from shm.pipeline.lineage import MOVES_NOTHING, redescribed
from shm.pipeline.reporting import hanger_report
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.store import IdentifiedTest, Lineage, Store, Workspace
from shm.store.recordings import list_holds
from shm.values import Drift, Hanger, ResponsePoint, Selection, WatchedTest
from tests.cli.conftest import Shm
from tests.helpers.flows import ingest
from tests.helpers.nouns import NOW, a_change, a_file, a_posterior, a_test
from tests.helpers.taken_in import ingest_quickly
from tests.helpers.web_servers import HTML, served
from tests.helpers.workspaces import START, make_workspace, modelled_test, put, write_test

LINEAGE = Lineage("0" * 64, "1" * 64, "0.1.0")
HANGERS = tuple(range(1, 11))
SHIFTS = {5: 0.021, 6: -0.05, 7: 0.026}


def watch(store: Store, hanger: int, shift: float) -> None:
    """Return a baseline at 11.5 deg C and a test at 31.5 deg C of one hanger."""
    for day, temperature in ((0, 11.5), (1, 31.5)):
        recording = store.recordings.receive(a_file(10 * hanger + day), NOW).recording
        name = f"h{hanger}-{day}"
        test = a_test(name, day, hanger=hanger, temperature_c=temperature)
        store.tests.save(recording.id, [IdentifiedTest(test)], LINEAGE, NOW)
    first, later = store.tests.list_all(hanger)
    posterior = a_posterior(tests=(first.test.id,))
    store.posteriors.save_selection(hanger, [first], Selection((posterior,), (1.0,)), LINEAGE, NOW)
    store.posteriors.save(later, a_posterior(tests=(later.test.id,)), LINEAGE, NOW)
    drift = Drift(
        hanger, later.test.id, NOW, "tension", 700e3, 700e3 * (1 + shift), shift, 0.002, 0.05, 0.5
    )
    baseline = store.watch.baseline(hanger)
    assert baseline is not None
    watched = WatchedTest(later.test.id, NOW, 31.5, (drift,), a_change())
    store.watch.save(later, baseline, watched, None, [], NOW)


@pytest.fixture(scope="module")
def arch(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Ten hangers; the last has no test, hanger 6 sheds load."""
    workspace = make_workspace(tmp_path_factory.mktemp("arch") / "bridge", hangers=HANGERS)
    with workspace.store() as store:
        for hanger in HANGERS[:-1]:
            watch(store, hanger, SHIFTS.get(hanger, 0.0))
    return workspace


def test_drift_bridge_names_the_hanger_that_shed_load(shm: Shm, arch: Workspace) -> None:
    """As a document, and in a table that ends in a sentence for the owner."""
    document = shm.at(arch).json("drift bridge")
    assert document["schema"] == "shm.bridge_pattern/1"
    assert document["explanations"][0]["name"] == "load redistribution"
    assert document["suspects"][0]["hangers"] == [6]
    assert [row["hanger"] for row in document["rows"]] == list(HANGERS[:-1])
    assert document["not_compared"][0]["hanger"] == 10
    assert document["rows"][0]["position_m"] is None
    assert document["sentence"].startswith("Load has moved from hanger 6 to its neighbours.")
    told = shm.at(arch).told("drift bridge")
    for said in ("not compared", "load redistribution", "3 further explanations",
                 "Load has moved from hanger 6 to its neighbours. Hanger 6 lost 35."):  # fmt: skip
        assert said in told


def test_drift_bridge_states_a_common_shift(shm: Shm, tmp_path: Path, on_bridge: Shm) -> None:
    """Of too few hangers there is no answer yet."""
    workspace = make_workspace(tmp_path / "alike", hangers=HANGERS)
    with workspace.store() as store:
        for hanger in HANGERS:
            watch(store, hanger, -0.012)
    told = shm.at(workspace).told("drift bridge")
    assert "All hangers shifted alike, by -1." in told
    assert "a temperature, a clock or a load" in told
    ended = on_bridge("drift bridge")
    assert ended.code == 4
    assert "Test more hangers" in ended.err


ANEW = f"drift rebaseline --hanger 3 --since {START:%Y-%m-%d} --why x"


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
def test_baseline_of_discarded_test(shm: Shm, tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "discarded")
    for day in (0, 30, 60):
        write_test(workspace.spool / f"t{day}.modes.json", workspace, day=day)
    ingest_quickly(workspace)
    shm = shm.at(workspace)
    shm.done("ingest --discard t0 --why 'loose sensor' --who Ann")
    with workspace.store() as store:
        data = hanger_report(workspace, store, 3, START)
    assert data.discarded == ("t0",)
    first = " ".join(as_text(hanger_paper(data)).splitlines()[:8])
    assert "The baseline of hanger 3 was made from t0, discarded since" in first
    assert hanger_json(data)["discarded_of_baseline"] == ["t0"]
    shm.done(ANEW)
    with workspace.store() as store:
        assert hanger_report(workspace, store, 3, START).discarded == ()


def test_changed_length_is_said_first(before: Workspace, shm: Shm) -> None:
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
    with served(workspace) as site, site.client() as client:
        page = client.get("/hangers/3", headers=HTML).text
    start = page.index("<main")
    assert 0 < page.index("has changed since its baseline") - start < 1500
    assert "described otherwise since the baseline: 3" in shm.at(workspace)("doctor").out
    shm.at(workspace).done(ANEW)
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


def test_every_other_field_of_a_hanger_is_compared(before: Workspace) -> None:
    """A field that is added to a hanger must be compared, or be said to move nothing."""
    with before.store() as store:
        baseline = store.watch.baseline(3)
    assert baseline is not None
    assert baseline.described is not None
    for name in sorted({each.name for each in fields(Hanger)} - MOVES_NOTHING):
        other = replace(baseline, described={**baseline.described, name: "another"})
        found = redescribed(before.bridge.hanger(3), other)
        assert [each.split()[0] for each in found] == [name]


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
            page = client.get(f"/hangers/{number}", headers=HTML).text
            table = page[page.index("The bar as described") :].split("</table>")[0]
            assert "diameter 130 mm" in table
            assert "Ann" in table


SAID = "Hanger 3: its baseline does not fit."


@pytest.fixture(scope="module")
def doubted(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 with two tests, most modes of the first of which are another thing."""
    workspace = make_workspace(tmp_path_factory.mktemp("doubted") / "bridge")
    hanger = workspace.bridge.hangers[0]
    wild = np.random.default_rng(3).uniform(0.75, 1.3, 12).tolist()
    first = modelled_test("t0", hanger)
    modes = tuple(
        replace(mode, frequency_hz=mode.frequency_hz * factor)
        for mode, factor in zip(first.modes, wild, strict=True)
    )
    tests = [replace(first, modes=modes), modelled_test("t1", hanger, day=30)]
    for test in tests:
        put(workspace.spool / f"{test.id}.modes.json", dump(modes_document([test])))
    ingest(workspace)
    with workspace.store() as store:
        for hold in list_holds(store):
            store.recordings.accept(hold.recording_id, "Ann", "as measured", START)
    ingest(workspace)
    return workspace


def test_status_and_report_begin_with_a_baseline_in_doubt(shm: Shm, doubted: Workspace) -> None:
    assert SAID in shm.at(doubted)("status").told
    (row,) = shm.at(doubted).json("status")["hangers"]
    assert row["warnings"][0].startswith(SAID)
    assert row["left_out"] == []
    with doubted.store() as store:
        data = hanger_report(doubted, store, 3, START)
    text = " ".join(as_text(hanger_paper(data)).split())
    assert SAID in text
    undetermined = text.index("These modes do not determine the tension")
    assert text.index(SAID) < undetermined
    assert "No change" not in text[:undetermined]
