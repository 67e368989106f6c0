"""The generated pages are those that the code makes now; what the docs link to exists."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")]


@pytest.fixture(scope="module")
def build() -> ModuleType:
    spec = importlib.util.spec_from_file_location("docs_build", ROOT / "docs" / "build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", ["commands", "settings"])
def test_a_generated_page_is_what_the_code_makes(build: ModuleType, page: str) -> None:
    made = getattr(build, f"{page}_page")()
    assert (ROOT / "docs" / f"{page}.md").read_text() == made, "Run `make docs`."


@pytest.mark.parametrize(
    ("page", "name", "makes"),
    [("physics", "classes", "classes_table"), ("api", "examples", "examples")],
)
def test_a_generated_part_of_a_page_is_what_the_code_makes(
    build: ModuleType, page: str, name: str, makes: str
) -> None:
    text = (ROOT / "docs" / f"{page}.md").read_text()
    stands = text.split(f"<!-- {name} -->\n")[1].split(f"\n<!-- /{name} -->")[0]
    assert stands == getattr(build, makes)(), "Run `make docs`."


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text()):
        assert (page.parent / target).exists(), target


@pytest.mark.parametrize(
    ("page", "name", "word", "times"),
    [
        ("README.md", "selection", "solid2", 1),
        ("docs/validation.md", "selection", "| solid2", 4),
        ("docs/validation.md", "frequencies", "| A.5", 7),
    ],
)
def test_the_validation_tables_stand_in_their_pages(page, name, word, times) -> None:
    text = (ROOT / page).read_text()
    table = text.split(f"<!-- {name} -->")[1].split(f"<!-- /{name} -->")[0]
    assert table.count(word) == times
