"""Decision records: one page each, complete, and listed."""

from __future__ import annotations

import re

import pytest

from tests.helpers.pages import DOCS

RECORDS = sorted((DOCS / "decisions").glob("0*.md"))


@pytest.mark.parametrize("record", RECORDS, ids=lambda path: path.stem)
def test_record_is_complete(record) -> None:
    text = record.read_text(encoding="utf-8")
    assert text.startswith(f"# {record.stem[:4]}: ")
    assert re.findall(r"^## (.+)$", text, re.M) == ["Context", "Decision", "Consequences"]
    assert len(text.splitlines()) <= 80
    assert f"({record.name})" in (DOCS / "decisions" / "index.md").read_text(encoding="utf-8")


def test_record_numbers_are_found() -> None:
    """A number stays found when its record was merged with another."""
    text = (DOCS / "decisions" / "index.md").read_text(encoding="utf-8")
    numbers = [record.stem[:4] for record in RECORDS]
    merged = dict(re.findall(r"(\d{4}) in (\d{4})[,.]", text))
    assert set(merged.values()) <= set(numbers)
    assert sorted([*numbers, *merged]) == [f"{n:04}" for n in range(len(numbers) + len(merged))]
