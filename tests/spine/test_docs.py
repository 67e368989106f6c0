"""The generated pages are those that the code makes now; what the docs link to exists."""

from __future__ import annotations

import csv
import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType

import click
import pytest

from docs import validation_page
from shm.settings import TABLE
from shm_cli.main import run
from tests.benchmarks.thesis import thesis_data
from tests.helpers.command_lines import commands
from tests.helpers.pages import BUILT, DOCS, PAGES, ROOT, links, name_of

READ = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *PAGES]


@pytest.fixture(scope="module")
def build() -> ModuleType:
    spec = importlib.util.spec_from_file_location("docs_build", ROOT / "docs" / "build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_of_the_thesis_has_every_item_and_links_its_pages(build: ModuleType) -> None:
    page = build.thesis_page()
    assert page.count("\n| ") == len(thesis_data.checklist()) + 1
    assert "[physics.md](physics.md)" in page
    assert "`python tests/benchmarks/validate.py --table 3.1`" in page


def test_the_page_and_the_command_of_settings_name_every_one(
    build: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    page = build.settings_page()
    assert all(f"| `{row.name}` | {row.default} |" in page for row in TABLE)
    assert run(["settings"]) == 0
    printed = capsys.readouterr().out
    assert all(row.name in printed for row in TABLE)
    assert run(["settings", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["settings"]
    assert [each["setting"] for each in listed] == [row.name for row in TABLE]
    assert listed[0]["environment"] == "SHM_STORE"


def test_the_page_of_commands_has_every_verb_and_its_options(build: ModuleType) -> None:
    page = build.commands_page()
    assert [line for line in page.splitlines() if line.startswith("## shm ")][:2]
    for name, command in commands():
        section = page.split(f"## shm {name}\n")[1].split("\n## ")[0]
        for parameter in command.params:
            if isinstance(parameter, click.Option) and not parameter.hidden:
                assert parameter.opts[0] in section, f"shm {name}"


def test_built_pages_are_ignored_by_git_and_named_by_the_tree() -> None:
    ignored = (ROOT / ".gitignore").read_text().splitlines()
    index = (DOCS / "index.md").read_text()
    for page in BUILT:
        assert f"docs/{page.name}" in ignored
        assert f"\n{page.stem}\n" in index


@pytest.mark.parametrize(
    ("page", "name", "makes"),
    [
        ("docs/physics.md", "classes", "classes_table"),
        ("docs/api.md", "examples", "examples"),
        ("docs/api.md", "functions", "functions"),
        ("CONTRIBUTING.md", "house", "house"),
    ],
)
def test_a_generated_part_of_a_page_is_what_the_code_makes(
    build: ModuleType, page: str, name: str, makes: str
) -> None:
    text = (ROOT / page).read_text()
    stands = text.split(f"<!-- {name} -->\n")[1].split(f"\n<!-- /{name} -->")[0]
    assert stands == getattr(build, makes)(), "Run `make docs`."


def test_every_room_of_shm_has_its_place_in_the_picture_of_the_house(build: ModuleType) -> None:
    packages = {path.parent.name for path in (ROOT / "shm").glob("*/__init__.py")}
    modules = {path.stem for path in (ROOT / "shm").glob("*.py")} - {"__init__"}
    drawn = set(re.findall(r"^.. +shm\.(\w+) ", build.house(), re.M))
    assert drawn == packages | modules


@pytest.mark.parametrize("page", READ, ids=name_of)
def test_links_lead_to_files_of_the_repository(page: Path) -> None:
    for target, _ in links(page.read_text()):
        assert (page.parent / target).exists(), target
        assert (page.parent / target).resolve() not in BUILT, f"{target} is not in the repository"


@pytest.mark.parametrize(
    ("page", "name", "word", "times"),
    [
        ("docs/trials/validation.md", "selection", "| solid2", 2),
        ("docs/trials/validation.md", "frequencies", "| A.5", 3),
    ],
)
def test_the_validation_tables_stand_in_their_pages(page, name, word, times) -> None:
    text = (ROOT / page).read_text()
    table = text.split(f"<!-- {name} -->")[1].split(f"<!-- /{name} -->")[0]
    assert table.count(word) == times


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("frequencies", validation_page.largest_differences),
        ("selection", validation_page.counted_ten_times),
    ],
)
def test_the_page_of_validation_shows_the_whole_table_beside_it_in_short(name, shown) -> None:
    page = validation_page.PAGE.read_text()
    stands = page.split(f"<!-- {name} -->\n")[1].split(f"\n<!-- /{name} -->")[0]
    assert stands == shown(validation_page.kept(name))


def test_writing_the_page_of_validation_gives_what_is_kept(tmp_path: Path) -> None:
    copy = tmp_path / "validation.md"
    copy.write_text(validation_page.PAGE.read_text())
    copy.with_suffix("").mkdir()
    rows = {name: validation_page.kept(name) for name in ("frequencies", "selection")}
    validation_page.write(rows["frequencies"], rows["selection"], copy)
    assert copy.read_text() == validation_page.PAGE.read_text()
    for name, whole in rows.items():
        assert validation_page.kept(name, copy) == whole


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_manual_pages_link_inside_manual(page: Path) -> None:
    """Sphinx takes a Markdown file outside of `docs` for a missing page, and `make docs` fails."""
    targets = [(page.parent / name).resolve() for name, _ in links(page.read_text()) if name]
    outside = [t.name for t in targets if t.suffix == ".md" and not t.is_relative_to(DOCS)]
    assert outside == []


PROOF = {
    "Tension": ("tension from modes",),
    "Change": ("loss of 5 %, hammer tests",),
    "Diagnosis": (
        "cause of a gap, true cause named first",
        "sure of a false cause, true effect withheld",
    ),
    "Data": ("files, under kills and power cuts",),
    "Not tested": (),
}
"""The rows of docs/trials/proof.csv behind each sentence of trust in the README."""


@pytest.mark.parametrize("subject", PROOF)
def test_readme_states_proven_figures(subject: str) -> None:
    """Counts of several trials may be added: 14 of 22 and 7 of 21 make 21 of 43."""
    section = (ROOT / "README.md").read_text().split("## How far you can trust it\n")[1]
    found = re.findall(r"^- \*\*(.+?)\*\*: ((?:.+\n)(?:  .+\n)*)", section.split("\n## ")[0], re.M)
    assert [name for name, _ in found] == list(PROOF)
    sentence = " ".join(dict(found)[subject].split())
    with (DOCS / "trials/proof.csv").open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["what"] in PROOF[subject]]
    assert {row["what"] for row in rows} == set(PROOF[subject])
    proven: set[str] = set()
    for what in PROOF[subject]:
        cells = [f"{r['what']} {r['reached']}" for r in rows if r["what"] == what]
        counts = [[int(n) for n in pair] for c in cells for pair in COUNT.findall(c)]
        proven |= {figure for cell in cells for figure in FIGURE.findall(cell)}
        proven.add(" of ".join(str(sum(column)) for column in zip(*counts, strict=True)))
    stated = FIGURE.findall(sentence.replace("90 % interval", ""))
    assert bool(stated) == bool(PROOF[subject])
    assert set(stated) <= proven


FIGURE = re.compile(r"\d+ of \d+|\d+(?:\.\d+)?|third|eighth|one hanger of four")
COUNT = re.compile(r"(\d+) of (\d+)")


def test_glossary_defines_terms_once() -> None:
    rows = re.findall(r"^\| ([a-z ]+) \| (.+) \|$", (DOCS / "glossary.md").read_text(), re.M)
    terms = [term for term, meaning in rows if meaning != "meaning"]
    assert len(terms) == len(set(terms)) >= 30
    assert all(meaning.endswith(".") for _, meaning in rows if meaning != "meaning")
