"""`shm stream`: what permanent sensors send, what was noticed, what is kept or taken out."""

from __future__ import annotations

import math
from dataclasses import asdict
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import rich_click as click

from shm.documents import format_time
from shm.errors import NothingThere
from shm.pipeline import utc_now
from shm.pipeline.stream_state import (
    StreamCondition,
    against_hammer,
    stream_states,
    tension_words,
)
from shm.read import write
from shm.report.formatting import number
from shm.store import Store, Workspace
from shm.store.ring import ring_of
from shm.store.ring_export import recording_of
from shm.store.streams import list_stream_events
from shm.values import NAN
from shm.watch.ambient_hammer import AmbientBias
from shm_cli import completion, flags
from shm_cli.common import answer, open_workspace, opened_store, show, show_rows
from shm_daemon.heartbeat import duration_words

_from = click.argument("start", type=flags.Time(), metavar="FROM")
_to = click.argument("end", type=flags.Time(), metavar="TO")
_name = click.argument("name", metavar="NAME", shell_complete=completion.streams)


@click.group(invoke_without_command=True)
@click.option("--events", is_flag=True, help="What was noticed instead: gaps, clocks, sensors.")
@click.option(
    "--days",
    type=click.FloatRange(0, min_open=True),
    default=7.0,
    help="How far back --events looks.",
)
@flags.json
@click.pass_context
def command(ctx: click.Context, events: bool, days: float) -> None:
    """Show permanent sensors: what is live, what was lost.

    A stream is late once its last sample is 5 minutes old, silent after an hour. The share that was
    lost is of the last 24 hours, up to the last sample; what comes late takes it back. Apart are
    samples of a time that was there already, as of a clock that was set back: the first to come
    count. Tension is the change since the stream began, the weather taken off, with its 90 %
    interval. Where hammer tests were made while the sensors ran, it says what their frequencies
    differ by.

    \b
    Example: shm stream --json
    Example: shm stream --events --days 1
    """
    if ctx.invoked_subcommand is not None:
        return
    with opened_store() as (workspace, store):
        if not workspace.bridge.streams:
            raise NothingThere(
                "bridge.toml describes no stream.",
                remedy="Describe one there: docs/permanent_sensors.md shows how.",
            )
        if events:
            _show_events(store, utc_now() - timedelta(days=days))
        else:
            _show_streams(workspace, store, utc_now())


@command.command()
@_name
@_from
@_to
@flags.why
@flags.json
def keep(name: str, start: datetime, end: datetime, why: str) -> None:
    """Keep the samples of a period permanently.

    The ring takes out what is older than the setting `ring_days`, but for what is kept.

    \b
    Example: shm stream keep h3 2026-05-01T10:00Z 2026-05-01T10:20Z --why "heavy transport"
    """
    workspace = open_workspace()
    stream, ring = workspace.bridge.stream(name), ring_of(workspace)
    recording_of(ring, stream, start, end, workspace.settings.max_samples)
    ring.keep(name, start, end, why)
    answer(
        {"stream": name, "start": start, "end": end, "why": why},
        f"The samples of {name} from {format_time(start)} to {format_time(end)} are kept.",
    )


@command.command()
@_name
@_from
@_to
@click.argument("file", type=flags.NewFile(), metavar="FILE")
@flags.json
def export(name: str, start: datetime, end: datetime, file: Path) -> None:
    """Write the samples of a period as a recording for `shm identify`.

    FILE ends with .h5, .csv, .npz or .uff. What is missing is an empty value.

    \b
    Example: shm stream export h3 2026-05-01T10:00Z 2026-05-01T10:10Z h3.csv
    """
    workspace = open_workspace()
    stream = workspace.bridge.stream(name)
    found = recording_of(ring_of(workspace), stream, start, end, workspace.settings.max_samples)
    write(found, file)
    if flags.wants_json():
        about = {"file": str(file), "start": found.time, "samples": found.samples}
        show({"stream": name, "hanger": found.hanger, **about})
        return
    click.echo(f"{file}: {found.samples} samples of {len(found.channels)} channels.")


def _show_streams(workspace: Workspace, store: Store, now: datetime) -> None:
    states = stream_states(workspace, ring_of(workspace), store, now)
    hammers = [against_hammer(store, each.stream) for each in states]
    if flags.wants_json():
        show({"streams": [_document(*each) for each in zip(states, hammers, strict=True)]})
        return
    columns = ("stream", "hanger", "state", "last sample", "lag", "rate", "lost", "apart", "ring",
               "window", "tension")  # fmt: skip
    show_rows("Streams", columns, map(_cells, states))
    for each in hammers:
        if each.is_known:
            click.echo(each.text())


def _cells(state: StreamCondition) -> tuple[str, ...]:
    window = state.window
    last = f"{_time(window.window.start)} {window.window.kind}, {window.how}" if window else ""
    return (
        state.stream.name,
        str(state.stream.hanger),
        state.state,
        _time(state.last_sample),
        "" if state.lag is None else duration_words(state.lag),
        number(state.received_hz, ".4g", "") + (" Hz" if math.isfinite(state.received_hz) else ""),
        number(state.lost_share, ".2%", ""),
        f"{state.apart_s:.0f} s" if state.apart_s else "",
        f"{state.ring_bytes / 1e6:.1f} MB",
        last.strip(" ,"),
        tension_words(state.hour),
    )


def _document(state: StreamCondition, hammer: AmbientBias) -> dict[str, Any]:
    """Return an entry of `--json`; unknown numbers are NaN."""
    window, hour = state.window, state.hour
    return {
        "name": state.stream.name,
        "hanger": state.stream.hanger,
        "state": state.state,
        "last_sample": state.last_sample,
        "lag_s": NAN if state.lag is None else state.lag.total_seconds(),
        "behind_s": NAN if state.behind is None else state.behind.total_seconds(),
        "sampling_rate_hz": state.stream.sampling_rate_hz,
        "received_hz": state.received_hz,
        "lost_share_24h": state.lost_share,
        "apart_s_24h": state.apart_s,
        "ring_bytes": state.ring_bytes,
        "last_window": window.window.start if window else None,
        "last_window_kind": window.window.kind if window else "",
        "last_window_how": window.how if window else "",
        "last_window_modes": len(window.modes) if window else 0,
        "tension_shift": hour.compensated_shift if hour else NAN,
        "tension_shift_sd": hour.compensated_sd if hour else NAN,
        "learning": hour.learning if hour else "",
        "ambient_bias": hammer.common,
        "ambient_bias_sd": hammer.common_sd,
        "hammer_tests": hammer.most_tests,
    }


def _show_events(store: Store, since: datetime) -> None:
    found = list_stream_events(store, None, since)
    if flags.wants_json():
        show({"events": [asdict(event) for event in found]})
        return
    headings = ("stream", "what", "from", "to", "channel", "details")
    rows = [(e.stream, e.kind, _time(e.start), _time(e.end), e.channel, e.detail) for e in found]
    show_rows("Events of streams", headings, rows)


def _time(time: datetime | None) -> str:
    return "" if time is None else f"{time:%Y-%m-%d %H:%M:%S}"
