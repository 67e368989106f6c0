"""Where the tables of the identification benchmarks stand."""

from __future__ import annotations

from pathlib import Path

DOCS = Path(__file__).resolve().parents[3] / "docs" / "trials" / "identification_benchmarks.md"


def put(page: Path, name: str, fragment: str) -> None:
    """Puts a fragment between the marks of its name; the text around them stays."""
    opened, closed = f"<!-- {name} -->", f"<!-- /{name} -->"
    text = page.read_text(encoding="utf-8")
    before, rest = text.split(opened)
    after = rest.split(closed)[1]
    page.write_text(f"{before}{opened}\n{fragment}\n{closed}{after}", encoding="utf-8")
