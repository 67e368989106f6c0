"""`shm update` and `shm select`: the documents of DESIGN, from files alone or from a workspace."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from shm.store import Workspace
from tests.cli.conftest import Shm

QUANTILES = {"mean", "sd", "q05", "q50", "q95", "map"}
QUICK = ("--samples", 100)


def call(modes_file: Path, hanger_file: Path, *more: object) -> tuple[object, ...]:
    known = ("update", modes_file, "--hanger-file", hanger_file, "--model", "beam1", "--seed", 5)
    return (*known, *QUICK, "--json", *more)


def test_the_document_of_update_has_the_keys_of_the_contract_and_repeats(
    shm: Shm, modes_file: Path, hanger_file: Path
) -> None:
    ended = shm(*call(modes_file, hanger_file))
    assert ended.code == 0, ended.err
    document = ended.document
    assert set(document) >= {
        "model", "tension_n", "parameters", "log_evidence", "log_evidence_sd", "probability",
        "samples", "effective_sample_size", "r_hat", "predicted", "seconds", "seed",
    }  # fmt: skip
    assert set(document["tension_n"]) == QUANTILES
    assert set(document["parameters"]) == {"theta_F", "theta_L", "sigma"}
    assert document["tension_n"]["mean"] == pytest.approx(0.9 * 711e3, rel=0.05)
    assert (document["model"], document["seed"], document["samples"]) == ("beam1", 5, 100)
    assert document["predicted"][0]["measured_hz"] > 0
    again = shm(*call(modes_file, hanger_file)).document
    assert {**again, "seconds": 0} == {**document, "seconds": 0}


def test_a_data_set_counted_ten_times_weighs_more(
    shm: Shm, modes_file: Path, hanger_file: Path
) -> None:
    once, tenfold = (
        shm(*call(modes_file, hanger_file, "--repeat", repeat)).document for repeat in (1, 10)
    )
    assert tenfold["log_evidence"] > once["log_evidence"] + 10


def test_select_ranks_the_models_and_their_probabilities_add_to_one(
    shm: Shm, modes_file: Path, hanger_file: Path
) -> None:
    ended = shm(
        "select", modes_file, "--hanger-file", hanger_file, "--models", "beam1, beam1",
        *QUICK, "--json",
    )  # fmt: skip
    document = ended.document
    assert document["selected"] == document["models"][0]["model"]
    assert sum(model["probability"] for model in document["models"]) == pytest.approx(1)


def test_the_tables_name_units_and_intervals(shm: Shm, modes_file: Path, hanger_file: Path) -> None:
    updated = shm("update", modes_file, "--hanger-file", hanger_file, "--model", "beam1", *QUICK)
    assert "tension (kN)" in updated.out
    assert "R-hat" in updated.out
    selected = shm("select", modes_file, "--hanger-file", hanger_file, "--models", "beam1", *QUICK)
    assert "90 % interval (kN)" in selected.out


def test_the_latest_test_of_a_hanger_of_the_workspace_is_taken(shm: Shm, bridge: Workspace) -> None:
    ended = shm(
        "--workspace", bridge.folder, "update", "--hanger", 3, "--model", "beam1", *QUICK, "--json"
    )
    assert ended.document["tests"] == ["t2"]
    assert ended.document["tension_n"]["mean"] == pytest.approx(0.8 * 711e3, rel=0.05)


def test_a_file_may_name_its_hanger_of_the_workspace(
    shm: Shm, bridge: Workspace, modes_file: Path
) -> None:
    ended = shm(
        "--workspace", bridge.folder, "update", modes_file, "--model", "beam1", *QUICK, "--json"
    )
    assert ended.code == 0, ended.err
    assert ended.document["hanger"] == 3


def test_a_description_of_another_hanger_is_remarked(
    shm: Shm, hanger_file: Path, modes_file: Path, tmp_path: Path
) -> None:
    other = tmp_path / "other.modes.json"
    other.write_text(json.dumps({**json.loads(modes_file.read_text()), "hanger": 7}))
    ended = shm("update", other, "--hanger-file", hanger_file, "--model", "beam1", *QUICK)
    assert ended.code == 0
    assert "the tests are of hanger 7, the description is of hanger 3" in ended.err


def test_a_hanger_without_tests_is_nothing_there(shm: Shm, bridge: Workspace) -> None:
    ended = shm("--workspace", bridge.folder, "select", "--hanger", 4)
    assert ended.code == 4
    assert "shm ingest" in ended.err


@pytest.mark.parametrize(
    ("content", "said"),
    [("", "not JSON"), ('{"schema": "shm.modes/1", "tests": []}', "missing or empty")],
)
def test_a_wrong_file_is_bad_input(
    shm: Shm, tmp_path: Path, hanger_file: Path, content: str, said: str
) -> None:
    path = tmp_path / "wrong.modes.json"
    path.write_text(content)
    ended = shm("update", path, "--hanger-file", hanger_file)
    assert ended.code == 3
    assert said in ended.err
    assert "wrong.modes.json" in ended.err


def test_the_textbook_method_warns_in_plain_words(modes_file: Path, hanger_file: Path) -> None:
    arguments = [str(a) for a in call(modes_file, hanger_file, "--method", "textbook")]
    program = [sys.executable, "-c", "from shm_cli.main import main; main()"]
    ended = subprocess.run([*program, *arguments], capture_output=True, text=True, check=True)
    assert ended.stderr.startswith("Warning: textbook TMCMC: a bias of -1 to -7")
    assert ".py" not in ended.stderr
    assert json.loads(ended.stdout)["model"] == "beam1"


@pytest.mark.parametrize(
    "command", [("update", "--model", "beam1"), ("select", "--models", "beam1")]
)
def test_a_mode_that_is_left_out_is_said(
    shm: Shm, modes_file: Path, hanger_file: Path, command: tuple[str, ...]
) -> None:
    document = json.loads(modes_file.read_text(encoding="utf-8"))
    mode = document["tests"][0]["modes"][0]
    mode |= {"irregular": True, "frequency_hz": 1.2 * mode["frequency_hz"]}
    modes_file.write_text(json.dumps(document), encoding="utf-8")
    ended = shm(*command, modes_file, "--hanger-file", hanger_file, *QUICK, "--json")
    assert f"Left out: {mode['plane']} {mode['order']} of test" in ended.err
    found = ended.document["models"][0] if command[0] == "select" else ended.document
    assert found["tension_n"]["mean"] == pytest.approx(0.9 * 711e3, rel=0.05)
    assert len(found["predicted"]) == len(document["tests"][0]["modes"]) - 1


@pytest.mark.parametrize(
    "command", [("update", "--model", "beam1"), ("select", "--models", "beam1")]
)
def test_a_class_that_misses_the_frequencies_by_far_is_said(
    shm: Shm, modes_file: Path, hanger_file: Path, command: tuple[str, ...]
) -> None:
    call = (*command, modes_file, "--hanger-file", hanger_file, *QUICK, "--json")
    assert "Poor fit" not in shm(*call).err
    document = json.loads(modes_file.read_text(encoding="utf-8"))
    for test in document["tests"]:
        test["modes"] = [mode | {"order": mode["order"] + 1} for mode in test["modes"]]
    modes_file.write_text(json.dumps(document), encoding="utf-8")
    ended = shm(*call)
    assert ended.code == 0
    assert "Poor fit: beam1 misses the frequencies by" in ended.err
    assert "look at the orders of the modes" in ended.err
