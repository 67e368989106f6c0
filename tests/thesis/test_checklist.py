"""Every item of the thesis is found where the checklist says."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from shm_cli import thesis, update, validate
from shm_cli.validation import formulas, selection
from tests.helpers.nouns import a_posterior

ROOT = Path(__file__).parents[2]
ITEMS = thesis.checklist()
CLAMPED_FORMULAS = ("Zui, first order", "Zui, second order", "Ren")
COMMANDS = sorted({item["where"] for item in ITEMS if item["where"].startswith("shm ")})
VALIDATE = [each for each in COMMANDS if each.startswith("shm validate")]
SELECT = [each for each in COMMANDS if each.startswith("shm select")]
# Beams and what was measured: a second. The solids take seconds each, the choice among all classes
# and the sampled formulas minutes.
QUICK = [e for e in VALIDATE if "--figure 2" in e or e.split()[-1] in ("1.1", "A.6", "A.7")]
MINUTES = [
    "shm validate",
    "shm validate --formulas",
    *(f"shm validate --table {n}.1" for n in "56"),
]
SECONDS = [each for each in VALIDATE if each not in (*QUICK, *MINUTES)]


def numbered(kind: str, chapter: str, last: int) -> list[str]:
    return [f"{kind} {chapter}.{number}" for number in range(1, last + 1)]


# By the thesis's own lists of figures and tables, its equations and its appendices.
OF_THE_THESIS = [
    *(each for chapter, last in (("1", 3), ("2", 7), ("3", 20), ("5", 37), ("B", 14))
      for each in numbered("figure", chapter, last)),
    *(each for chapter, last in (("1", 1), ("3", 3), ("5", 1), ("6", 1), ("A", 7))
      for each in numbered("table", chapter, last)),
    *numbered("equation", "2", 47),
    *numbered("equation", "4", 18),
    *(f"section {number}" for number in [
        "1.1", "1.2", "1.3", "1.4", "2.1", "2.2", "2.3", "2.4.1", "2.4.2", "2.4.3", "2.4.4",
        "3.1.1", "3.1.2", "3.2.1", "3.2.2", "3.2.3", "3.3", "4.1", "4.2.1", "4.2.2", "4.2.3",
        "4.3", "5.1", "5.2", "5.3", "6.1", "6.2",
    ]),
]  # fmt: skip


def covered(of: str) -> set[str]:
    """What an item is of: "Figures 3.1 to 3.4, 3.6" are five."""
    found: set[str] = set()
    kind = ""
    for word, first, last in re.findall(
        r"([A-Za-z]{5,})?[ ,]*(?:and )?([\dAB](?:\.\d+)+)(?: to ([\dAB]\.\d+))?", of
    ):
        kind = word.lower().rstrip("s") or kind
        chapter, _, number = first.rpartition(".")
        until = int(last.rpartition(".")[2]) if last else int(number)
        found |= {f"{kind} {chapter}.{each}" for each in range(int(number), until + 1)}
    return found


def test_nothing_that_the_thesis_numbers_is_missing() -> None:
    listed = set().union(*(covered(item["of"]) for item in ITEMS))
    assert sorted(set(OF_THE_THESIS) - listed) == []
    assert not any("missing" in item["where"] for item in ITEMS)


def test_every_page_of_it_exists() -> None:
    pages = [item["where"] for item in ITEMS if item["where"].startswith("docs/")]
    assert pages
    assert [page for page in pages if not (ROOT / page).is_file()] == []


def test_every_figure_has_its_own_command_and_every_table() -> None:
    """Of the many of chapter 5 and appendix B one of each class stands for all."""
    figures = {name.split()[1] for name in OF_THE_THESIS if name.startswith("figure")}
    pictures = {f"1.{n}" for n in (1, 2, 3)} | {"2.1", "2.2"}
    pictures |= {f"3.{n}" for n in (1, 2, 3, 4, 6, 8, *range(10, 16))}
    assert set(validate.FIGURES) == figures - pictures
    tables = {name.split()[1] for name in OF_THE_THESIS if name.startswith("table")}
    assert set(validate.TABLES) == tables
    assert {f"shm validate --table {number}" for number in tables} <= set(VALIDATE)
    drawn = {f"shm validate --figure {n}" for n in validate.FIGURES if n[0] in "23"}
    assert drawn <= set(VALIDATE)


@pytest.mark.parametrize(
    "command",
    [
        *QUICK,
        *(pytest.param(each, marks=pytest.mark.slow) for each in SECONDS),
        *(pytest.param(each, marks=pytest.mark.trial) for each in MINUTES),
    ],
)
def test_a_command_of_it_runs(command: str, tmp_path: Path) -> None:
    arguments = command.split()[2:]
    drawn = ["--out", str(tmp_path / "figure.png")] if "--figure" in arguments else []
    result = CliRunner().invoke(validate.command, [*arguments, *drawn, "--json"])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "figure.png").is_file() == bool(drawn)


# By the quickest classes and few samples: what a class costs is of no interest here.
@pytest.mark.filterwarnings("ignore:textbook TMCMC")  # what it says of that method is true
@pytest.mark.parametrize("command", SELECT)
def test_a_selection_of_it_runs(command: str) -> None:
    files = {"MODES.json": str(thesis.PRINTINGS["table 1.1"]), "H.toml": str(thesis.HANGER_FILE)}
    arguments = [files.get(word, word) for word in command.split()[2:]]
    classes = ["--models", "beam1,beam2" if "--prior" in arguments else "beam1"]
    result = CliRunner().invoke(
        update.select_command, [*arguments, *classes, "--samples", "200", "--json"], obj={}
    )
    assert result.exit_code == 0, result.output


def test_evidence_and_summary_stand_beside_the_thesis_s(monkeypatch: pytest.MonkeyPatch) -> None:
    """The choice among all classes takes minutes: one row of it stands for all."""
    row = selection.SelectionRow(
        "table 1.1", 10, "beam2", 1, -53.6, 0.03, -5.3, -18.3, 802, 798, 841, 0.13, -0.04,
        {"theta_F": 1.2}, 711, 14.4,
    )  # fmt: skip
    monkeypatch.setattr(selection, "compared", lambda *_: [row])
    told = {
        number: CliRunner().invoke(validate.command, ["--table", number]).output
        for number in ("5.1", "6.1")
    }
    assert all(word in told["5.1"] for word in ("-53.60 ± 0.03", "-5.3", "497.11", "-18.3"))
    assert all(word in told["6.1"] for word in ("+13% / -4%", "-4%", "14 s", "5 min"))


def test_the_list_names_every_item() -> None:
    output = CliRunner().invoke(validate.command, ["--list", "--json"]).output
    assert all(item["of"] in output for item in ITEMS)


def test_the_list_says_where_the_files_of_its_commands_lie() -> None:
    output = CliRunner().invoke(validate.command, ["--list"]).output
    assert f"H.toml: {thesis.HANGER_FILE}" in output


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--figure", "2.4", "--table", "A.5"], "--figure and --table are not one question"),
        (["--formulas", "--list"], "--formulas and --list are not one question"),
        (["--figure", "2.4", "--out", "figure.jpg"], "figure.jpg is no name of a .png file"),
        (["--figure", "2.4", "--out", "no/figure.png"], "is no folder"),
    ],
)
def test_what_cannot_be_answered_is_refused_before_it_is_computed(
    arguments: list[str], said: str
) -> None:
    result = CliRunner().invoke(validate.command, arguments)
    assert result.output == ""
    assert said in str(result.exception)


def test_formulas_stand_beside_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    """The sampler is left out: it is tested where it lives, and takes seconds a hanger."""
    tension_n = np.array([700e3, 720e3])
    ours = replace(a_posterior(), samples=tension_n[:, None], names=("theta_F",))
    monkeypatch.setattr(formulas, "update", lambda *_: replace(ours, nominal_tension_n=1.0))
    result = CliRunner().invoke(validate.command, ["--formulas", "--json"])
    assert result.exit_code == 0, result.output
    clamped, springs, unequal = json.loads(result.output)[:3]
    assert clamped["ours"] == pytest.approx(710 / 711 - 1)
    assert clamped["xi"] == pytest.approx(6.04, abs=0.01)
    # Ren and both of Zui suppose clamped ends: close there, half of the tension off on springs.
    assert all(abs(clamped["formulas"][n]) < 0.03 for n in CLAMPED_FORMULAS)
    assert all(springs["formulas"][n] < -0.5 for n in CLAMPED_FORMULAS)
    # Springs of both ends alike are what the last row supposes; a tenth and more off on others.
    fitted = [each["formulas"]["equal springs"] for each in (clamped, springs, unequal)]
    assert fitted[:2] == pytest.approx([0.0, 0.0], abs=1e-4)
    assert fitted[2] < -0.05
