"""Profiles of loggers: what a person said once of the files of one logger, kept in the workspace.

A profile is a sidecar for all files of one layout: `loggers/NAME.toml`, written by `shm import`.

    fingerprint = "04130264baace706"
    format = "Excel"
    columns = ["Kraft [N]", "Beschl 1 [g]"]
    hanger = 3
    day_order = "month first"

    [channel."Beschl 1"]
    plane = "transverse"
    x_m = 2.52

`day_order` says how days such as 05/01/2026 are read. It is learnt from the first file of the
logger whose days can be read in one order alone; where later ones prove the other it is `mixed`,
and such days are asked of a person.

A sidecar of its own goes before it, and so does a hanger or a rate that the file itself says. With
`roams = true`, which a logger that has been at two hangers gets by itself, a profile names no
hanger: each file must say its own.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, tzinfo
from pathlib import Path
from typing import Any

from shm.errors import BadInput
from shm.read.atomic import replace_text
from shm.read.base import Layout
from shm.read.content import read_toml
from shm.read.header import CHANNEL_KEYS
from shm.read.logger_words import hanger_numbered
from shm.read.sidecar import Described, sidecar_text
from shm.read.stamps import DAY_ORDERS, DayOrder, in_zone

FOLDER = "loggers"
DAY_ORDER = "day_order"
MIXED = "mixed"
"""The `day_order` of a logger whose files have proven both."""
_OF_PROFILE = ("hanger", "sampling_rate_hz", DAY_ORDER, "channel")
_COMMENT = (
    "# What the files of one logger do not say themselves, as `shm import` asked. It holds for\n"
    "# every file with these columns; correct it here, or import a file again.\n"
)
_REWRITE = "Correct it, or delete it and import a file of the logger again."


@dataclass(frozen=True)
class Profile:
    """A profile as its file says it; `described` as a sidecar would."""

    path: Path
    fingerprint: str
    described: Described
    roams: bool = False

    @property
    def answers_questions(self) -> bool:
        """Return whether a person has described the logger, and it was not only read."""
        return self.roams or bool(self.described.keys() - {DAY_ORDER})


def profile_for(layout: Layout, workspace: Path) -> Profile | None:
    """Return the profile of the logger whose files look so; None where there is none.

    Raises BadInput naming a profile that is damaged.
    """
    found = (_load(path) for path in _files(workspace))
    return next((each for each in found if each.fingerprint == layout.fingerprint), None)


def any_profile(workspace: Path) -> bool:
    """Return whether any logger was imported into this workspace."""
    return bool(_files(workspace))


def completed(
    profile: Described,
    layout: Layout,
    in_sidecar: Described,
    file_name: str = "",
    zone: tzinfo = UTC,
) -> dict[str, Any]:
    """Return the sidecar of one file: what its own says, and what name and profile add to that.

    `zone` is that of clocks which name none.
    """
    added = {key: profile[key] for key in _OF_PROFILE if key in profile}
    order = added.pop(DAY_ORDER, MIXED)
    for each in layout.possible_times:
        if each.order == order:
            added["time"] = in_zone(each.time, zone)
    if layout.local_time is not None and zone is not UTC:
        added["time"] = in_zone(layout.local_time, zone)
    named = hanger_numbered(file_name)
    if named is not None:
        added["hanger"] = named
    if layout.hanger is not None:
        added.pop("hanger", None)
    if layout.has_rate:
        added.pop("sampling_rate_hz", None)
    listed = in_sidecar.keys() & set(CHANNEL_KEYS)  # lists in the order of the channels
    names = {**added.get("channel", {}), **in_sidecar.get("channel", {})}
    channels = {
        name: {
            **{k: v for k, v in added.get("channel", {}).get(name, {}).items() if k not in listed},
            **in_sidecar.get("channel", {}).get(name, {}),
        }
        for name in names
    }
    whole = {**added, **in_sidecar}
    return {**whole, "channel": channels} if channels else whole


def with_day_order(known: Described, order: DayOrder | None) -> dict[str, Any]:
    """Return what a profile says, with the order of day and month that a file of it proves."""
    if order is None:
        return dict(known)
    is_new = known.get(DAY_ORDER, order) == order
    return {**known, DAY_ORDER: order if is_new else MIXED}


def learn_day_order(layout: Layout, order: DayOrder | None, workspace: Path) -> Profile | None:
    """Store the order of day and month that a file of a logger proves; return its profile.

    Return None where the logger has no profile and nothing is proven.
    """
    profile = profile_for(layout, workspace)
    known = profile.described if profile is not None else {}
    learnt = with_day_order(known, order)
    if learnt == known:
        return profile
    return save_profile(learnt, layout, workspace, roams=profile is not None and profile.roams)


def save_profile(
    described: Described, layout: Layout, workspace: Path, *, roams: bool = False
) -> Profile:
    """Save the description of a logger's files as its profile, in place of an earlier one."""
    before = profile_for(layout, workspace)
    stored = {key: described[key] for key in _OF_PROFILE if key in described}
    moved = roams or (before is not None and _moved(before, stored))
    if moved:
        stored.pop("hanger", None)
    path = before.path if before is not None else _free_path(layout, workspace)
    head = {
        "fingerprint": layout.fingerprint,
        "format": layout.format,
        "columns": list(layout.columns),
        **({"roams": True} if moved else {}),
    }
    path.parent.mkdir(exist_ok=True)
    replace_text(path, _COMMENT + sidecar_text({**head, **stored}))
    return Profile(path, layout.fingerprint, stored, moved)


def _moved(before: Profile, stored: Described) -> bool:
    """Return whether a logger was used at two hangers, so that no profile can know the next."""
    former = before.described.get("hanger")
    return before.roams or (former is not None and stored.get("hanger", former) != former)


def _files(workspace: Path) -> list[Path]:
    return sorted((workspace / FOLDER).glob("*.toml"))


def _free_path(layout: Layout, workspace: Path) -> Path:
    first = layout.columns[0] if layout.columns else layout.format
    word = re.sub(r"[^a-z0-9]+", "-", f"{layout.format} {first}".lower()).strip("-")[:40]
    return workspace / FOLDER / f"{word or 'logger'}-{layout.fingerprint[:6]}.toml"


def _load(path: Path) -> Profile:
    document = read_toml(path, _REWRITE)
    channels = document.get("channel", {})
    if not isinstance(document.get("fingerprint"), str) or not isinstance(channels, dict):
        raise BadInput("is no profile of a logger.", file=path, remedy=_REWRITE)
    for name, table in channels.items():
        unknown = set(table) - set(CHANNEL_KEYS) if isinstance(table, dict) else {str(table)}
        if unknown:
            raise BadInput(
                f"{sorted(unknown)[0]!r} is not a key of a channel.",
                file=path,
                channel=name,
                remedy=f"The keys are {', '.join(CHANNEL_KEYS)}.",
            )
    known = {key: document[key] for key in _OF_PROFILE if key in document}
    orders = (*DAY_ORDERS, MIXED)
    if known.get(DAY_ORDER, MIXED) not in orders:
        raise BadInput(
            f"{DAY_ORDER} = {known[DAY_ORDER]!r} is no order of day and month.",
            file=path,
            remedy=f"Write one of {', '.join(orders)}.",
        )
    roams = document.get("roams") is True
    if roams:
        known.pop("hanger", None)
    return Profile(path, document["fingerprint"], known, roams)
