"""No package of a plain installation declares a licence of the GPL family: `shm notices`."""

from __future__ import annotations

import re

from shm_cli.installation import notices

# GPL, LGPL and AGPL bind whoever passes the software on: such packages are extras (npTDMS is one).
_COPYLEFT = re.compile(r"\b[AL]?GPL|GNU .*General Public", re.IGNORECASE)
_NAMED = re.compile(r"MIT|BSD|Apache|PSF|Python Software Foundation|MPL|Mozilla")


def test_each_package_that_is_required_declares_a_licence_outside_the_gpl_family() -> None:
    found = {each.package.lower(): each.licence for each in notices() if not each.extra}
    assert {"numpy", "alembic", "contourpy"} <= set(found)
    assert sum(name.startswith("charset") for name in found) == 1
    assert {n: text for n, text in found.items() if not _NAMED.search(text)} == {}
    assert {n: text for n, text in found.items() if _COPYLEFT.search(text)} == {}


def test_such_a_licence_would_be_noticed_and_is_told_of_the_extras() -> None:
    of_extras = {each.package: each for each in notices() if _COPYLEFT.search(each.licence)}
    assert {"npTDMS", "psycopg", "psycopg-binary"} <= set(of_extras)
    assert (of_extras["npTDMS"].extra, of_extras["psycopg-binary"].extra) == ("tdms", "postgres")
    assert not {"pytest", "hatchling"} & {each.package for each in notices()}
