"""The `[[stream]]` tables of `bridge.toml`: loggers that send for good, and their sensors."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from shm.bridge.table import Table
from shm.errors import BadInput, NotDescribed
from shm.values import NAN, PLANES, Hanger
from shm.values.stream import SeedLinkFeed, Stream, StreamChannel

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
"""What is at once a folder, a level of an MQTT topic and a part of an address."""

_FEED_KEYS = ("kind", "server", "channels", "calibration")
_SERVER = re.compile(r"([A-Za-z0-9][A-Za-z0-9.-]*)(?::([1-9][0-9]{0,4}))?")
_SEED_ID = re.compile(r"[A-Z0-9]{1,8}_[A-Z0-9]{1,8}_[A-Z0-9]{0,8}_[A-Z0-9]{3}")


def is_stream_name(text: str) -> bool:
    """Return True if a stream or a channel may have that name."""
    return _NAME.fullmatch(text) is not None


def stream_of(values: dict[str, Any], path: Path, hangers: Mapping[int, Hanger]) -> Stream:
    """Return the stream of a `[[stream]]` table; raises BadInput naming table and key at fault."""
    table = Table(values, f"stream {values.get('name', '?')}", path)
    asked = _FEED_KEYS if "kind" in table else ()
    table.refuse_unknown(("name", "hanger", "sampling_rate_hz", "channel", *asked))
    name = _name(table, "h7")
    number = table.value("hanger", int, "is not a whole number", "Give the id of its hanger.")
    if number not in hangers:
        known = ", ".join(map(str, sorted(hangers))) or "none"
        raise table.refusal(
            f"hanger = {number} is not described (known: {known})",
            "Add a [[hanger]] table with this id, or correct the number.",
        )
    channels = tuple(_channel(each, hangers[number]) for each in table.tables("channel"))
    if not channels:
        raise table.refusal("it has no channels", "Write a [[stream.channel]] for each sensor.")
    _refuse_doubles([channel.name for channel in channels], table)
    feed = _feed(table, len(channels)) if "kind" in table else None
    return Stream(name, number, table.positive("sampling_rate_hz"), channels, feed)


def _feed(table: Table, n_channels: int) -> SeedLinkFeed:
    """Return the server that is asked for the samples of a stream; raises BadInput."""
    remedy = 'Write kind = "seedlink", or leave it out for a logger that sends.'
    table.value("kind", str, "is not known", remedy, holds=lambda kind: kind == "seedlink")
    wrong, remedy = "is no host and port", 'Write server = "logger.example.org:18000".'
    server = _SERVER.fullmatch(
        table.value("server", str, wrong, remedy, holds=lambda text: bool(_SERVER.fullmatch(text)))
    )
    assert server is not None
    each = f"one for each of the {n_channels} [[stream.channel]] tables, in their order"
    codes = [f'"XX_HGR3_00_HN{number}"' for number in range(1, n_channels + 1)]
    worth = ["2.4e-6"] * n_channels
    ids = table.value(
        "channels",
        tuple[str, ...],
        f"is not {each}",
        f"Write network, station, location and code: channels = [{', '.join(codes)}].",
        holds=lambda found: len(found) == n_channels and all(map(_SEED_ID.fullmatch, found)),
    )
    if len(set(ids)) < len(ids):
        raise table.refusal("channels names one twice", "Name each channel once.")
    calibrations = table.value(
        "calibration",
        tuple[float, ...],
        f"is not {each}, and none 0",
        f"Give what a count of each is worth in m/s2: calibration = [{', '.join(worth)}].",
        holds=lambda found: len(found) == n_channels and all(found),
    )
    parts = tuple(tuple(text.split("_")) for text in ids)
    return SeedLinkFeed(server[1], int(server[2] or 18000), parts, calibrations)


def _channel(table: Table, hanger: Hanger) -> StreamChannel:
    table.refuse_unknown(("name", "plane", "x_m", "full_scale"))
    wrong, remedy = "is none of the planes", f"Give {' or '.join(PLANES)}."
    plane = table.value("plane", str, wrong, remedy, holds=PLANES.__contains__)
    x_m = table.not_negative("x_m")
    if x_m > hanger.length_m:
        raise table.refusal(
            f"x_m = {x_m:g} is beyond hanger {hanger.id}, which is {hanger.length_m:g} m long",
            "Measure it from the deck end, in m.",
        )
    full_scale = table.positive("full_scale") if "full_scale" in table else NAN
    return StreamChannel(_name(table, "acc_1"), plane, x_m, full_scale)


def _name(table: Table, example: str) -> str:
    return str(
        table.value(
            "name",
            str,
            "is no name of at most 64 letters, digits, - and _",
            f'Write name = "{example}".',
            holds=is_stream_name,
        )
    )


def _refuse_doubles(names: list[str], table: Table) -> None:
    if pair := _same_names(names):
        raise table.refusal(f"channel {_both(*pair)}", "Give each a name of its own.")


def streams_of(
    tables: list[dict[str, Any]], path: Path, hangers: Mapping[int, Hanger]
) -> tuple[Stream, ...]:
    """Return the streams of all `[[stream]]` tables; raises BadInput."""
    streams = tuple(stream_of(table, path, hangers) for table in tables)
    if pair := _same_names([stream.name for stream in streams]):
        remedy = "Give each a name of its own: each has a folder, and some disks know no capitals."
        raise BadInput(f"stream name {_both(*pair)}.", file=path, remedy=remedy)
    _refuse_second(streams, path)
    return streams


def _refuse_second(streams: Sequence[Stream], path: Path) -> None:
    """Refuse two streams of a hanger: the watch learns sensors and clock, and would begin anew."""
    first: dict[int, str] = {}
    for each in streams:
        if each.hanger in first:
            raise BadInput(
                f"streams {first[each.hanger]} and {each.name} are both of hanger {each.hanger}; "
                "the watch of a hanger takes one.",
                file=path,
                remedy="Describe all its sensors as channels of one stream, which one logger "
                "sends. For a second logger describe the hanger again under another id.",
            )
        first[each.hanger] = each.name


def _same_names(names: Sequence[str]) -> tuple[str, str] | None:
    """Return two names that differ in capitals only."""
    seen: dict[str, str] = {}
    for name in names:
        if name.lower() in seen:
            return seen[name.lower()], name
        seen[name.lower()] = name
    return None


def _both(one: str, other: str) -> str:
    if one == other:
        return f"{one} is given twice"
    return f"{other} is {one} but for capitals"


def stream_named(streams: tuple[Stream, ...], name: str) -> Stream:
    """Return the stream of that name; raises BadInput when the bridge has none such."""
    for stream in streams:
        if stream.name == name:
            return stream
    known = ", ".join(stream.name for stream in streams) or "none"
    meant = next((each.name for each in streams if each.name.lower() == name.lower()), None)
    raise NotDescribed(
        f"stream {name[:64]!r} is not described in bridge.toml (known: {known}).",
        remedy=f"Capitals count: write {meant}."
        if meant
        else "Add a [[stream]] table with this name, or correct the name.",
    )
