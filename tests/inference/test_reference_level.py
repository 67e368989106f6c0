"""Frequencies at a level of motion: closed forms, and the tension of a bar whose truth is known."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shm.bridge import load_hanger
from shm.documents import dump
from shm.errors import BadInput
from shm.inference import UpdateOptions, update
from shm.inference.reference_level import at_level
from shm.models import DESCRIPTION, THESIS, build
from shm.modes_document import modes_document
from shm.values import PLANES, FloatArray, Hanger, ModalTest, Mode
from shm_cli.main import run
from tests.helpers.flows import ingest
from tests.helpers.workspaces import START, make_workspace, put

SLOPE, SLOPE_SD, SD = -2e-3, 1e-4, 1e-4
HITS = 2.0


def modal_test(*slopes: float, amplitude: float = HITS, slope_sd: float = SLOPE_SD) -> ModalTest:
    modes = tuple(
        Mode("transverse", order, 10.0, 10 * SD, amplitude_slope=slope, amplitude_slope_sd=slope_sd)
        for order, slope in enumerate(slopes, start=1)
    )
    return ModalTest("t", modes, 3, amplitude=amplitude)


def test_at_level_of_hits_adds_slope() -> None:
    moved = at_level(modal_test(SLOPE), HITS)

    (mode,) = moved.modes
    assert mode.frequency_hz == pytest.approx(10 * (1 + SLOPE))
    assert mode.frequency_sd_hz == pytest.approx(10 * math.hypot(SD, SLOPE_SD))
    assert (moved.amplitude, moved.frequencies_amplitude) == (HITS, HITS)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_at_level_between_holds_all_laws(share: float) -> None:
    (mode,) = at_level(modal_test(SLOPE, slope_sd=0.0), share * HITS).modes

    spread = math.sqrt((mode.frequency_sd_hz / 10) ** 2 - SD**2)
    change = mode.frequency_hz / 10 - 1
    for law in (share, share**2, share * 1.1 / (share + 0.1)):  # friction, stretching, slip
        assert abs(change - SLOPE * law) < 2 * spread


@pytest.mark.parametrize(
    ("test", "level", "wrong"),
    [
        (modal_test(SLOPE), 2.1, "above 2"),
        (modal_test(math.nan), 1.0, "does not say"),
        (modal_test(SLOPE, amplitude=math.nan), 1.0, "does not say"),
    ],
)
def test_at_level_refuses_unknown(test: ModalTest, level: float, wrong: str) -> None:
    with pytest.raises(BadInput, match=wrong) as refused:
        at_level(test, level)

    assert refused.value.remedy


def hardening_test(hanger: Hanger, rise: float) -> ModalTest:
    """Return a test of a sprung bar whose tension rises by so much at the level of its hits."""
    model = build("beam2", hanger, THESIS)

    def frequencies_hz(tension: float) -> FloatArray:
        known = {"theta_F": tension, "theta_L": 1.0}
        theta = np.array([[known.get(name, 7.3) for name in model.parameter_names]])
        found: FloatArray = model.frequencies_hz(theta, 5)[0]
        return found

    rest, hit = frequencies_hz(1.0), frequencies_hz(1.0 + rise)
    modes = tuple(
        Mode(
            plane, order + 1, float(rest[row, order]), float(SD * rest[row, order]),
            amplitude_slope=float(hit[row, order] / rest[row, order] - 1),
            amplitude_slope_sd=2e-5,
        )
        for row, plane in enumerate(PLANES)
        for order in range(5)
    )  # fmt: skip
    return ModalTest("t", modes, hanger.id, START, 11.5, HITS)


def test_at_level_tension_follows_hardening(hanger_file: Path) -> None:
    hanger, rise = load_hanger(hanger_file), 0.02
    test = hardening_test(hanger, rise)
    model, options = build("beam2", hanger, DESCRIPTION), UpdateOptions(400, 1)

    rest, hit = (update([at_level(test, level)], model, options) for level in (0.0, HITS))

    change = hit.tension_n.mean() / rest.tension_n.mean() - 1
    sds = [each.repeatability_sd_n / hanger.nominal_tension_n for each in (rest, hit)]
    assert abs(change - rise) < 3 * math.hypot(*sds)
    assert 3 * math.hypot(*sds) < rise


@pytest.fixture
def hanger_file(tmp_path: Path) -> Path:
    workspace = make_workspace(tmp_path / "described")
    text = (workspace.folder / "bridge.toml").read_text()
    path = tmp_path / "H.toml"
    path.write_text("[[hanger]]" + text.split("[[hanger]]")[1].split("[settings]")[0])
    return path


@pytest.mark.parametrize("verb", ["update", "select"])
def test_at_level_option_says_level(
    verb: str, hanger_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    modes = hanger_file.with_name("t.modes.json")
    put(modes, dump(modes_document([hardening_test(load_hanger(hanger_file), 0.01)])))
    models = ("--model", "beam2") if verb == "update" else ("--models", "beam1,beam2")
    call = (verb, str(modes), "--hanger-file", str(hanger_file), *models, "--samples", "100")

    assert run([*call, "--at-level", "1.0", "--json"]) == 0
    shown = capsys.readouterr()

    assert json.loads(shown.out)["at_level"] == 1.0
    assert "10 of 10 frequencies depend on it" in shown.err
    assert run([*call, "--at-level", "3"]) == 3


@pytest.mark.parametrize(("level", "known"), [(1.0, True), (3.0, False)])
def test_report_states_reference_level(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], level: float, known: bool
) -> None:
    settings = {"models": "beam2", "reference_level": level}
    workspace = make_workspace(tmp_path / "bridge", settings=settings)
    test = hardening_test(replace(workspace.bridge.hangers[0]), 0.01)
    put(workspace.spool / "t.modes.json", dump(modes_document([test])))
    ingest(workspace)
    call = ["--workspace", str(workspace.folder), "report", "--hanger", "3"]

    assert run([*call, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)["at_level"]
    assert run(call) == 0

    assert document["force_n"] == 1000 * level
    assert (document["tension_n"] is not None) == known
    assert ("above 2" in document["reason"]) != known
    assert f"At hits of {1000 * level:.4g} N" in capsys.readouterr().out
