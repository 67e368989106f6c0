"""The examples of the manual run, end with what they assert, and say what they show."""

from __future__ import annotations

import ast
import runpy
from pathlib import Path

import pytest

from tests.helpers.slow import few_of

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("*.py"))


@pytest.mark.parametrize("example", few_of(EXAMPLES, 3), ids=lambda path: path.stem)
def test_example_finds_the_truth(example: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = runpy.run_path(str(example), run_name="__main__")
    assert capsys.readouterr().out
    assert found["figure"].axes
    assert (ROOT / "docs" / "static" / "examples" / f"{example.stem}.png").is_file()


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_says_what_it_shows_and_asserts_it(example: Path) -> None:
    tree = ast.parse(example.read_text(encoding="utf-8"))
    assert len((ast.get_docstring(tree) or "").splitlines()) >= 3
    assert sum(isinstance(node, ast.Assert) for node in ast.walk(tree)) >= 3


def test_examples_are_numbered() -> None:
    assert [path.stem[:3] for path in EXAMPLES] == [f"{n:02d}_" for n in range(1, 13)]
