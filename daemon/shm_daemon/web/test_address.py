"""Where a test is found: its name may hold anything a file name may, and more."""

from __future__ import annotations

from urllib.parse import quote


def test_page(hanger_id: int, name: str) -> str:
    """The address of a test's page."""
    return f"/hangers/{hanger_id}/tests/{quote(name, safe='')}"


def test_json(hanger_id: int, name: str) -> str:
    """The address of what is known of a test, in numbers; its figures lie below it."""
    return f"/api{test_page(hanger_id, name)}"


test_page.__test__ = test_json.__test__ = False  # type: ignore[attr-defined]  # no pytest cases
