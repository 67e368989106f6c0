"""Strands, turnbuckles, plates, any section: the examples of docs/hangers.md are run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from shm.bridge import load_hanger
from shm.models import MODELS
from shm.models.classes.beam import Beam1
from shm.store import Workspace
from shm.values import Hanger
from tests.cli.conftest import Shm
from tests.helpers.workspaces import make_workspace

DOCS = Path(__file__).resolve().parents[2] / "docs" / "hangers.md"
EXAMPLES = re.findall(r"^## ([^\n]+)\n+```toml\n(.*?)```", DOCS.read_text(), re.S | re.M)
QUICK = ("--samples", 100)
SPRINGS = [part for k in range(1, 5) for part in ("--set", f"log10_k{k}=7")]


class Plated(Beam1):
    """A class that needs end plates."""

    name = "plated"

    @classmethod
    def unfit(cls, hanger: Hanger) -> str:
        return "" if hanger.plate else "it needs end plates: give [hanger.plate]."


@pytest.fixture(autouse=True)
def _plated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(MODELS, "plated", Plated)


@pytest.fixture
def described(tmp_path: Path) -> dict[str, Path]:
    """Return the examples as hanger files, by their headings."""
    files = {}
    for number, (heading, text) in enumerate(EXAMPLES):
        files[heading] = tmp_path / f"H{number}.toml"
        files[heading].write_text(text)
    return files


def test_the_docs_describe_five_kinds_of_hanger(described: dict[str, Path]) -> None:
    plate, strand, turnbuckle, flat, swinging = map(load_hanger, described.values())
    assert plate.plate is not None
    assert strand.bending_stiffness_factor < 1
    assert len(turnbuckle.turnbuckles) == 1
    assert flat.models == ("beam1", "beam2")
    assert not swinging.as_hanger


@pytest.mark.parametrize("heading", [heading for heading, _ in EXAMPLES])
def test_docs_example_is_near_string(shm: Shm, described: dict[str, Path], heading: str) -> None:
    """n/(2 L) sqrt(T/m), raised by the bending stiffness, lowered by a turnbuckle's mass."""
    hanger = load_hanger(described[heading])
    if not hanger.as_hanger:
        pytest.skip("a string is not held so; tests/models/test_supports.py has the closed forms")
    string = (hanger.nominal_tension_n / hanger.mass_per_length_kg_m) ** 0.5 / (2 * hanger.length_m)
    ended = shm("predict", "beam2", "--hanger-file", described[heading], *SPRINGS, "--json")
    assert ended.code == 0, ended.err
    first = ended.document["frequencies"][0]["frequency_hz"]
    assert 0.9 < first / string < 1.7


@pytest.mark.parametrize(
    ("tension", "supports", "said"),
    [
        ("500e3", "deck = 'free'", "hanger 14 is not clamped at both ends: only bars"),
        ("0.0", "both = 'clamped'", "hanger 14 carries no tension: only bars"),
        ("0.0", "both = 'free'", "is not clamped at both ends and carries no tension: only bars"),
    ],
)
def test_simulate_refuses_a_bar_that_is_held_otherwise_or_slack(
    shm: Shm, tmp_path: Path, tension: str, supports: str, said: str
) -> None:
    path = tmp_path / "H.toml"
    path.write_text(
        "[[hanger]]\nid = 14\nlength_m = 6.0\ndiameter_m = 0.1\nelastic_modulus_pa = 200e9\n"
        f"density_kg_m3 = 7850\nnominal_tension_n = {tension}\n[hanger.supports]\n{supports}\n"
    )
    out = tmp_path / "tests"
    ended = shm("simulate", "--hanger-file", path, "--out", out)
    assert ended.code == 2
    assert said in " ".join(ended.err.split())
    assert "[hanger.supports]" in ended.err
    assert not out.exists()


def test_class_does_not_apply(shm: Shm, hanger_file: Path, modes_file: Path) -> None:
    ended = shm("predict", "plated", "--hanger-file", hanger_file)
    assert ended.code == 2
    assert "does not apply to hanger 3: it needs end plates" in ended.err
    assert "Classes that apply: beam1, " in ended.err
    call = ("select", modes_file, "--hanger-file", hanger_file, "--models", "plated,beam1", *QUICK)
    ended = shm(*call)
    assert ended.code == 0, ended.err
    assert "plated does not apply: it needs end plates: give [hanger.plate]." in ended.out
    document = shm(*call, "--json").document
    assert document["not_applicable"] == {"plated": "it needs end plates: give [hanger.plate]."}
    assert [model["model"] for model in document["models"]] == ["beam1"]
    ended = shm("select", modes_file, "--hanger-file", hanger_file, "--models", "plated", *QUICK)
    assert ended.code == 2
    assert "no model class applies to hanger 3" in ended.err
    assert "plated: it needs end plates" in ended.err


def test_select_takes_the_classes_of_the_setting_unless_told(shm: Shm, bridge: Workspace) -> None:
    """The workspace's setting is beam1 alone."""
    document = shm.at(bridge).json("select", "--hanger", 3, *QUICK)
    assert [model["model"] for model in document["models"]] == ["beam1"]
    assert document["not_applicable"] == {}


def test_status_says_why_a_class_does_not_apply(shm: Shm, tmp_path: Path) -> None:
    workspace = make_workspace(
        tmp_path / "bridge", hangers=(3, 4), settings={"models": "beam1,beam2,plated"}
    )
    path = workspace.folder / "bridge.toml"
    path.write_text(path.read_text().replace("id = 4", 'id = 4\nmodels = ["beam2"]'))
    rows = shm.at(workspace).json("status")["hangers"]
    assert [row["competing"] for row in rows] == [["beam1", "beam2"], ["beam2"]]
    assert set(rows[0]["not_applicable"]) == {"plated"}
    assert rows[0]["not_applicable"]["plated"].startswith("it needs")
    assert rows[1]["not_applicable"]["beam1"].startswith("the hanger's")
