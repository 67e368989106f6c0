"""The pages of the docs: those in the repository, and those that `make docs` builds."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
BUILT = {
    DOCS / f"{name}.md"
    for name in ("commands", "effects", "licences", "reference", "settings", "thesis")
}
"""Long reference that `shm VERB --help`, `settings` and `gap effects` give too: built, not kept."""
PAGES = sorted(
    {*DOCS.glob("*.md"), *(DOCS / "trials").glob("*.md"), DOCS / "decisions" / "index.md"} - BUILT
)
"""The manual's pages that the repository holds."""


def name_of(page: Path) -> str:
    """A page as the manual's tree calls it: `gap`, `trials/peers`."""
    return page.relative_to(DOCS if page.is_relative_to(DOCS) else ROOT).with_suffix("").as_posix()


def links(text: str) -> list[tuple[str, str]]:
    """(file, anchor) of all links to files; either may be empty."""
    return re.findall(r"\]\(([^)#:]*)(?:#([\w-]+))?\)", text)
