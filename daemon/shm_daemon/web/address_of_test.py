"""Where a test is found: its name may hold anything a file name may, and more."""

from __future__ import annotations

from urllib.parse import quote

_DOTS = (".", "..")
"""Names that a browser would take for a way up: they are followed by a slash."""


def test_page(hanger_id: int, name: str) -> str:
    """The address of a test's page."""
    told = f"{name}/" if name in _DOTS else name
    return f"/hangers/{hanger_id}/tests/{quote(told, safe='')}"


def test_json(hanger_id: int, name: str) -> str:
    """The address of what is known of a test, in numbers; its figures lie below it."""
    return f"/api{test_page(hanger_id, name)}"


def name_in(address: str) -> str:
    """The name of the test whose address ends so, decoded."""
    return address.removesuffix("/") if address.removesuffix("/") in _DOTS else address


test_page.__test__ = test_json.__test__ = False  # type: ignore[attr-defined]  # no pytest cases
