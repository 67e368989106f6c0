"""What is said of streams that say nothing, and of their hangers."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import pytest

from shm.pipeline.bridge_reporting import hanger_summaries, unwatched
from shm.pipeline.stream_health import (
    State,
    StreamHealth,
    blind_hangers,
    classify_stream,
    evaluate_silent_streams,
    heard,
    note_blindness,
)
from shm.read.chunk_document import chunk_document
from shm.report.hanger_status import Status
from shm.store.ring import ring_of
from shm.store.streams import list_stream_events
from shm.values.stream import StreamEvent
from tests.helpers.live_streams import send, with_live_streams
from tests.helpers.nouns import NOW
from tests.helpers.streams import MODES, STREAM, a_chunk, a_window, with_stream
from tests.helpers.workspaces import make_workspace

HOUR = timedelta(hours=1)


def an_event(kind: str, end: datetime) -> StreamEvent:
    return StreamEvent("h3", kind, end - HOUR, end, "")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("ago", "heard_ago", "kind", "state"),
    [
        (HOUR / 15, HOUR / 15, "gap", "live"),
        (HOUR / 15, HOUR / 15, "dead", "sensor at fault"),
        (HOUR / 15, HOUR / 15, "lost modes", "sees nothing"),
        (HOUR / 10, HOUR / 10, "lost modes", "late"),
        (2 * HOUR, 2 * HOUR, "dead", "silent"),
        (96 * HOUR, HOUR / 15, "dead", "late"),  # it sends what it stored
        (-HOUR, -HOUR, "dead", "clock ahead"),
    ],
)
def test_a_stream_is_in_one_state(
    ago: timedelta, heard_ago: timedelta, kind: str, state: State
) -> None:
    events = [an_event(kind, NOW - ago)]
    assert classify_stream(NOW - ago, NOW - heard_ago, events, NOW) == state


def test_a_backlog_of_days_that_comes_now_is_no_silence(tmp_path: Path) -> None:
    workspace = with_live_streams(make_workspace(tmp_path / "bridge"))
    sent_at = NOW + timedelta(days=4)
    send(workspace, hours=0.5, first=NOW, at=sent_at)
    with workspace.store() as store:
        for sealed in (False, True):
            if sealed:
                ring_of(workspace).seal(sent_at + HOUR / 60)
            (found,) = heard(workspace, store, sent_at + HOUR / 2)
            assert (found.state, found.last_sample) == ("late", NOW + HOUR / 2)
            evaluate_silent_streams(workspace, store, sent_at + HOUR / 2)
        assert store.alerts.list_all() == ()
        evaluate_silent_streams(workspace, store, sent_at + timedelta(days=2))
        (raised,) = store.alerts.list_all()
        assert raised.alert.time == sent_at  # from then on nothing came


def test_of_a_hanger_whose_stream_is_silent_nobody_says_that_nothing_needs_doing(
    tmp_path: Path,
) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    blind = blind_hangers([StreamHealth(STREAM, "silent", NOW)])
    lead = unwatched(workspace, 3, NOW, blind, NOW)
    assert lead is not None
    assert (lead.urgency, lead.state) == (
        "week", "Hanger 3: its stream h3 (last sample 2026-05-01 12:00 UTC) is silent."
    )  # fmt: skip
    assert unwatched(workspace, 2, NOW, blind, NOW) is None
    with workspace.store() as store:
        assert heard(workspace, store, NOW) == ()
        (never,) = heard(with_stream(workspace), store, NOW)
    assert (never.stream.name, never.state) == ("h3", "never sent")


def test_a_silence_of_a_day_is_one_alert_which_ends_with_it(tmp_path: Path) -> None:
    workspace = with_live_streams(make_workspace(tmp_path / "bridge"))
    send(workspace, hours=1 / 6, first=NOW)
    day, last = timedelta(days=1), NOW + HOUR / 6
    with workspace.store() as store:
        for later, alerts in ((day, 0), (day + 3 * HOUR, 1), (5 * day, 1)):
            evaluate_silent_streams(workspace, store, last + later)
            assert len(store.alerts.list_all(standing=True)) == alerts
        (raised,) = store.alerts.list_all()
        assert raised.alert.message.startswith(
            "Hanger 3: its stream hanger03 (last sample 2026-05-01 12:10 UTC) is silent for longer "
            "than a day. Look at its logger, power and connection within a week."
        )
        lines = hanger_summaries(workspace, store, last + 5 * day)
        assert {each.message.status for each in lines if each.hanger.id == 3} == {Status.UNCLEAR}
        send(workspace, hours=1 / 6, first=NOW + 5 * day)
        evaluate_silent_streams(workspace, store, NOW + 5 * day + HOUR / 2)
        (over,) = store.alerts.list_all()
        assert over.resolution is not None
        assert over.resolution.why == "stream hanger03 sees its hanger again"


def test_a_stream_that_saw_nothing_for_a_day_is_one_alert_until_it_sees_again(
    tmp_path: Path,
) -> None:
    workspace = with_live_streams(make_workspace(tmp_path / "bridge"))
    name = workspace.bridge.streams[0].name
    with workspace.store() as store:

        def sends(hours: float, *, blind: bool) -> int:
            send(workspace, hours=1 / 6, first=NOW + hours * HOUR)
            if blind:
                start = NOW + hours * HOUR
                event = StreamEvent(name, "lost modes", start, start + HOUR / 6, "no mode")
                store.streams.save_event(event)
            evaluate_silent_streams(workspace, store, NOW + (hours + 0.2) * HOUR)
            return len(store.alerts.list_all(standing=True))

        seen = a_window(0)
        own = replace(seen.window, stream=name)
        store.streams.save_window(replace(seen, window=own))
        assert [sends(hour, blind=True) for hour in (1, 25, 27, 28)] == [0, 0, 1, 1]
        (raised,) = store.alerts.list_all()
        assert raised.alert.time == NOW + HOUR / 6
        assert "is without any motion of it for longer than a day. See within a week whether" in (
            raised.alert.message
        )
        (line,) = (
            e for e in hanger_summaries(workspace, store, NOW + 28.2 * HOUR) if e.hanger.id == 3
        )
        assert line.message.status is Status.UNCLEAR
        evaluate_silent_streams(workspace, store, NOW + 60 * HOUR)  # silent: it sees no more
        assert len(store.alerts.list_all(standing=True)) == 1
        assert sends(70, blind=True) == 1  # it sends again, and sees nothing
        store.streams.save_window(replace(seen, window=replace(own, start=NOW + 71 * HOUR)))
        assert sends(71, blind=False) == 0
        assert {each.resolution.why for each in store.alerts.list_all() if each.resolution} == {
            f"stream {name} sees its hanger again"
        }


def test_a_stream_of_noise_is_noted_by_its_windows_and_said_to_see_nothing(tmp_path: Path) -> None:
    workspace = with_stream(make_workspace(tmp_path / "bridge"))
    with workspace.store() as store:
        for n in range(42):
            window = a_window(10 * n, MODES if n < 36 else ())
            level = 0.012 if n < 36 else 1e-4
            store.streams.save_window(
                replace(window, window=replace(window.window, level_m_s2=level))
            )
        for n in (40, 41):
            note_blindness(store, STREAM, a_window(10 * n).window.start)
        (event,) = list_stream_events(store, "h3", NOW)
        ring_of(workspace).append(chunk_document(a_chunk(0, event.end - timedelta(seconds=5))))
        (found,) = heard(workspace, store, event.end)
        assert found.state == "sees nothing"
        assert blind_hangers([found])[3].state.endswith("is without any motion of it.")
