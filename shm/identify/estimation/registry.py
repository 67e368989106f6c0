"""The identifiers by name; a new one is one file and one line here."""

from __future__ import annotations

from shm.errors import UsageError
from shm.identify.contract import Identifier
from shm.identify.estimation.response_fit import common_denominator_fit
from shm.identify.estimation.ssi import summed_hankel_ssi

IDENTIFIERS: dict[str, Identifier] = {
    "ssi": summed_hankel_ssi,
    "frf": common_denominator_fit,
}
WITHOUT_FORCE = frozenset({"ssi"})
"""Those that can do with accelerations alone. They see hits one by one, so that these need not be
of one direction."""


def identifier(name: str) -> Identifier:
    """The identifier of that name; raises UsageError for an unknown one."""
    if name not in IDENTIFIERS:
        raise UsageError(
            f"unknown identifier {name!r}.", remedy=f"Known: {', '.join(IDENTIFIERS)}."
        )
    return IDENTIFIERS[name]
