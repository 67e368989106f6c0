"""Who makes the reports of a bridge, as their head and their signatures name them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Letterhead:
    """What an owner's reports carry; empty texts and None: nothing is given.

    `logo` is an image file, which need not be there.
    """

    organisation: str = ""
    prepared_by: str = ""
    checked_by: str = ""
    logo: Path | None = None


NO_LETTERHEAD = Letterhead()
