"""The licence of everything that a plain installation brings along, as its package declares it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from importlib import metadata

from packaging.requirements import Requirement

# GPL, LGPL and AGPL bind whoever passes the software on: such packages are extras (npTDMS is one).
_COPYLEFT = re.compile(r"\b[AL]?GPL|GNU .*General Public", re.IGNORECASE)
_NAMED = re.compile(r"MIT|BSD|Apache|PSF|Python Software Foundation|MPL")


def _brought(name: str, found: dict[str, str]) -> Mapping[str, str]:
    """The declared licence by package name, of all that `name` requires without any extra."""
    for text in metadata.requires(name) or ():
        wanted = Requirement(text)
        if wanted.name in found or (wanted.marker and not wanted.marker.evaluate({"extra": ""})):
            continue
        found[wanted.name] = "; ".join(_declared(wanted.name))
        _brought(wanted.name, found)
    return found


def _declared(name: str) -> Iterator[str]:
    fields = metadata.metadata(name)
    classifiers = [c for c in fields.get_all("Classifier") or () if c.startswith("License ::")]
    # A licence given as its whole text names the licences of others: its first line is its own.
    first = next(iter((fields.get("License") or "").strip().splitlines()), "")
    yield from filter(None, (fields.get("License-Expression"), *classifiers, first))


def test_each_required_package_declares_a_licence_that_binds_nobody_further() -> None:
    found = _brought("shm", {})
    assert {"numpy", "alembic", "contourpy"} <= set(found)
    assert {n: text for n, text in found.items() if not _NAMED.search(text)} == {}
    assert {n: text for n, text in found.items() if _COPYLEFT.search(text)} == {}


def test_a_copyleft_licence_would_be_noticed() -> None:
    assert _COPYLEFT.search("; ".join(_declared("npTDMS")))
