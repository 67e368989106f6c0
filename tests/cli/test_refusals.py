"""What cannot be done is said with its exit code, in words and with --json, and nothing changes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from shm.documents import dump
from shm.modes_document import modes_document
from shm.store import Workspace
from tests.cli.conftest import Shm
from tests.helpers.workspaces import modelled_test

KINDS = {2: "usage", 3: "bad_input", 4: "nothing_there"}
SINCE = "--since 2026-05-01 --why x"
ADOPT = "gap adopt --hanger 3"
PREDICT = "predict beam1 --hanger 3"
# On a bridge whose hanger 3 has three tests and two alerts, and whose hanger 4 has none.
BRIDGE = (
    ("frobnicate", 2, "No such command"),
    ("report", 2, "--hanger"),
    ("report --hanger 99", 4, "known: 3, 4"),
    ("report --hanger three", 2, "three"),
    ("report --hanger 4", 4, "shm ingest"),
    ("report --hanger 3 --since soon", 2, "90d"),
    ("report --hanger 3 --since tomorrow", 2, "90d"),
    ("report --hanger 3 --test t1 --since 90d", 2, "either --test or --since"),
    ("report --since 90d", 2, "--bridge"),
    ("report --bridge --hanger 3", 2, "--bridge"),
    ("report --bridge --test t", 2, "Give --hanger N with --test"),
    ("report --hanger 3 --since 2026-07-01", 4, "t2"),
    ("report --hanger 3 --since 2026-07-01", 4, "2026-06-30"),
    ("report --bridge --since 2026-07-01", 4, "t2"),
    ("report --bridge --since 2026-07-01", 4, "2026-06-30"),
    ("report --hanger 3 --test t9", 4, "t2"),
    ("report --hanger 3 --test t0", 4, "t0.modes.json gave the modes"),
    ("drift --hanger 9", 4, "known: 3, 4"),
    ("drift --since 2026-05-01", 2, "No such option"),
    ("alerts silence --hanger 3 --until yesterday --why x", 2, "Write a day as 2026-05-01"),
    ("drift --hanger 4", 4, "no test has been compared"),
    ("alerts --hanger 9", 4, "known: 3, 4"),
    ("export --hanger 9 --out {tmp}/x.csv", 4, "known: 3, 4"),
    ("export --hanger 4 --out {tmp}/x.csv", 4, "hanger 4"),
    ("export --hanger 3 --out {tmp}/s.xls", 2, ".csv, .nc, .json or .npz"),
    ("select --hanger 4", 4, "shm ingest"),
    ("gap diagnose --hanger 4", 4, "shm ingest"),
    ("gap diagnose --bridge", 4, "shm ingest"),
    ("alerts ack 7 --why x", 4, "no alert 7. See `shm alerts`."),
    ("alerts ack 1", 2, "--why"),
    ("alerts ack 1 --why ' '", 2, "it is empty"),
    ("alerts ack x --why x", 2, "ID"),
    ("alerts test", 2, "--hook"),
    ("alerts test --hook nope", 2, "nope"),
    ("drift rebaseline --hanger 3 --since 2027-01-01 --why x", 4, "no test since 2027-01-01"),
    ("drift rebaseline --hanger 3 --since lately --why x", 2, "--since"),
    ("drift rebaseline --hanger 3 --since tomorrow --why x", 2, "--since"),
    ("drift rebaseline --hanger 3 --why x", 2, "--since"),
    ("drift rebaseline --hanger 3 --since 2026-05-01 --why ' '", 2, "it is empty"),
    (f"drift rebaseline --hanger 3 --kind painted {SINCE}", 2, "--kind"),
    (f"drift rebaseline {SINCE}", 2, "--hanger"),
    (f"drift rebaseline --hanger 4 {SINCE}", 4, "no baseline yet"),
    (f"drift rebaseline --hanger 9 {SINCE}", 4, "hanger 9"),
    (f"{ADOPT} --effect gremlins --why x", 2, "unknown effect"),
    (f"{ADOPT} --effect effective_length --why x", 2, "Give --at"),
    (f"{ADOPT} --effect sensor_mass --why x", 2, "of the sensors"),
    (f"{ADOPT} --effect temperature_tension --why x", 3, "single"),
    (f"{ADOPT} --effect geometric_hardening --why x", 3, "diagnos"),
    ("gap adopt --hanger 4 --effect sag --why x", 4, "no baseline yet"),
    ("gap adopt --hanger 9 --effect sag --why x", 4, "hanger 9"),
    (f"{ADOPT} --effect sag", 2, "--why"),
    (f"{ADOPT} --effect point_mass --why ' '", 2, "it is empty"),
    ("gap drop --hanger 3 --why x", 4, "adopted nothing"),
    ("gap drop --hanger 3 --why ' '", 2, "it is empty"),
    ("gap adopted --hanger 3", 4, "no effect has been adopted"),
    (f"{PREDICT} --set theta_F=-1", 2, "theta_F"),
    (f"{PREDICT} --set theta_F=nan", 2, "theta_F"),
    (f"{PREDICT} --sweep theta_F=0.9:1.1:0", 2, "theta_F"),
    (f"{PREDICT} --sweep theta_F=0.9:1.1:100000000", 2, "theta_F"),
    (f"{PREDICT} --set theta_F", 2, "NAME=VALUE"),
    (f"{PREDICT} --set theta_X=1", 2, "unknown ['theta_X']"),
    (f"{PREDICT} --sweep theta_F=1:2", 2, "NAME=FROM:TO:N"),
    (f"{PREDICT} --set theta_L=-1", 2, "no frequencies at theta_F=1, theta_L=-1"),
    (f"{PREDICT} --set theta_L=0", 2, "no frequencies at theta_F=1, theta_L=0"),
    ("predict beam9 --hanger 3", 2, "beam1, "),
    ("predict beam2 --hanger 3 --set log10_k2=12", 2, "log10_k1"),
    ("predict beam1", 2, "which hanger?"),
    ("note add x", 2, "--bridge"),
    ("note add x --bridge --hanger 3", 2, "--bridge"),
    ("note add x --hanger 99", 4, "99"),
    ("note add x --bridge --at 2999-01-01", 2, "has not come yet"),
    ("note add x --bridge --photo {tmp}/notes.txt", 3, "JPEG or PNG"),
    ("stream export h9 2026-05-01 2026-05-02 {tmp}/x.csv", 4, "is not described"),
    ("stream", 4, "permanent_sensors.md"),
    ("db restore {tmp}/notes.txt", 3, "notes.txt"),
    ("db restore {tmp}/none.db", 4, "none.db"),
    ("archive prune", 2, "--keep-days"),
    ("ingest {tmp}/none.csv", 2, "does not exist"),
    ("ingest --held {tmp}/notes.txt", 2, "--held"),
    ("ingest --time 2026-05-01", 2, "--confirm"),
    ("ingest --discard 1", 2, "--why"),
    ("ingest --confirm 99", 4, "99"),
    ("ingest --confirm nobody", 4, "nobody"),
    ("init {bridge}", 2, "workspace already"),
    ("web --host 192.0.2.1", 2, "shm token create"),
    ("web --host 0.0.0.0", 2, "shm token create"),
    ("daemon --web --host 0.0.0.0", 2, "shm token create"),
)
# Of files alone, beside the description of hanger 3.
OF = "--hanger-file {hanger}"
SIMULATED = f"acquire {OF} --device simulated --out {{tmp}}/t.zip --hammer 1.9:transverse:5000"
SENSOR = "--sensor 2.5:transverse:400"
CHECK = f"gap check {{modes}} {OF} --effects distributed_mass,timebase --sound 1"
FILES = (
    ("identify {tmp}/none.csv", 2, "does not exist"),
    ("identify {tmp}/empty.csv", 3, "the file is empty"),
    ("identify {tmp}/rateless.csv", 3, "sampling rate is missing"),
    ("identify {tmp}/empty.csv {tmp}/rateless.csv --html {tmp}/sheet.html", 2, "--together"),
    (f"update {{tmp}}/empty.csv {OF}", 3, "not JSON"),
    (f"update {{tmp}}/empty.csv {OF}", 3, "empty.csv"),
    (f"update {{tmp}}/testless.json {OF}", 3, "missing or empty"),
    (f"update {{modes}} {OF} --model beam1+sag", 2, "BASELINE+EFFECT@WHERE"),
    (f"select {{modes}} {OF} --sampler tmcmc", 2, "tmcmc"),
    (f"gap diagnose {{modes}} {OF} --without ghosts", 2, "ghosts"),
    (f"gap diagnose {{modes}} {OF} --baseline beam9", 2, "beam9"),
    (f"gap diagnose {{modes}} {OF} --hold-out t77", 2, "t77"),
    (f"gap diagnose {{tmp}}/twice.modes.json {OF}", 3, "given 2 times"),
    (f"gap diagnose {{tmp}}/rateless.csv {OF}", 3, "shm identify FILE --out"),
    (f"gap diagnose {{modes}} {OF} --html {{tmp}}/none/g.html", 3, "none is no folder"),
    (f"gap diagnose {{modes}} {OF} --figures {{tmp}}/none/g", 3, "none is no folder"),
    ("gap diagnose {modes} {hanger} {modes}", 2, "H.toml"),
    ("gap diagnose {modes} {modes}", 2, "H.toml"),
    ("gap diagnose --bridge {modes} {hanger}", 2, "pairs"),
    (f"{CHECK} --effects rust", 2, "there is no effect rust"),
    (f"{CHECK} --effects ''", 2, "names no effect"),
    (f"{CHECK} --figure c.pdf", 3, "no name of a picture"),
    (f"{CHECK} --baseline beam9", 2, "beam9"),
    (f"{CHECK} --seeds 0", 2, "--seeds"),
    (f"{SIMULATED} --hammer 1.9:5000 {SENSOR}", 2, "X:PLANE:FULL_SCALE"),
    (f"{SIMULATED} --sensor 2.5:vertical:400", 2, "X:PLANE:FULL_SCALE"),
    (f"{SIMULATED} --sensor 2.5:transverse:0", 2, "X:PLANE:FULL_SCALE"),
    (f"{SIMULATED} {SENSOR} --out {{tmp}}/t.csv", 2, "no .zip"),
    (f"settings {OF}", 2, "--assumptions"),
    ("predict beam1 --hanger-file {tmp}/empty.csv", 3, "0 [[hanger]] tables"),
    ("--workspace {tmp}/arhc status", 3, "{tmp}/arhc"),
    ("--workspace {tmp}/arhc status", 3, "shm init"),
    ("--workspace {tmp}/notes.txt status", 3, "notes.txt"),
)  # fmt: skip
NOWHERE = (
    "export --hanger 3 --out {}/e.npz", "report --hanger 3 --format json --out {}/r.json",
    "report --bridge --format text --out {}/r.txt", "gap diagnose --hanger 99 --html {}/g.html",
)  # fmt: skip
AS_JSON = {"export", "daemon", "web", "frobnicate"}
"""Verbs that have no --json, or are none."""


@pytest.fixture
def files(
    tmp_path: Path, bridge: Workspace, hanger_file: Path, modes_file: Path
) -> dict[str, Path]:
    test = modelled_test("t1", bridge.bridge.hanger(3))
    for name, content in (
        ("notes.txt", "buy milk"), ("empty.csv", ""), ("rateless.csv", "force\n1\n"),
        ("testless.json", '{"schema": "shm.modes/1", "tests": []}'),
        ("twice.modes.json", dump(modes_document([test, test]))),
    ):  # fmt: skip
        (tmp_path / name).write_text(content)
    return {"tmp": tmp_path, "bridge": bridge.folder, "hanger": hanger_file, "modes": modes_file}


def assert_refused(shm: Shm, line: str, code: int, said: str) -> None:
    ended = shm(line)
    assert ended.code == code, ended.err
    assert said in ended.said
    assert ended.out == ""
    for word in ("Traceback", "Unexpected", "Errno"):
        assert word not in ended.err
    assert "--help" in ended.err or re.search(r"[.?] ", ended.said), ended.err
    if not AS_JSON & set(line.split()):
        ended = shm(f"{line} --json")
        document = ended.document
        assert (ended.code, document["exit_code"], document["schema"]) == (
            code, code, "shm.error/1",
        )  # fmt: skip
        assert document["error"] == KINDS[code]
        assert len(document["message"]) > 8
        assert len(document["remedy"]) > 8
        assert " ".join(document["message"].split())[:20] in ended.said


@pytest.mark.parametrize(("line", "code", "said"), BRIDGE)
def test_workspace_refuses(
    on_bridge: Shm, bridge: Workspace, files: dict[str, Path], line: str, code: int, said: str
) -> None:
    before = bridge.database.read_bytes()
    assert_refused(on_bridge, line.format(**files), code, said)
    assert bridge.database.read_bytes() == before


@pytest.mark.parametrize(("line", "code", "said"), FILES)
def test_files_alone_are_refused(
    shm: Shm, files: dict[str, Path], line: str, code: int, said: str
) -> None:
    assert_refused(shm, line.format(**files), code, said.format(**files))


@pytest.mark.parametrize("line", NOWHERE)
def test_unwritable_place_is_told_first(on_bridge: Shm, tmp_path: Path, line: str) -> None:
    nowhere = tmp_path / "no" / "such"
    assert_refused(on_bridge, line.format(nowhere), 3, str(nowhere))
