"""`shm status`: what the workspace holds and what waits.

With --of ID, each stage that a recording or test has gone through, and every result it ever had.
"""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import datetime, timedelta
from itertools import chain
from typing import TYPE_CHECKING, Any

import rich_click as click

from shm.documents import creep_document
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import HangersNow
from shm.pipeline.courier import quiet_until
from shm.pipeline.stream_health import stream_leads
from shm.report.control_report import chart_document
from shm.report.formatting import Interval, with_half
from shm.report.hanger_status import Status, bridge_message
from shm.report.hanger_summary import HangerSummary
from shm.report.open_warnings import dated_by_receipt
from shm.store import Decision, DeliveryState, Store, Workspace
from shm.store.alerts import count_deliveries, count_raised, describe_silence
from shm.store.journal import list_events, list_former_tests, list_steps
from shm.store.point_outbox import PointOutbox
from shm.store.recordings import (
    count_stages,
    find_oldest_waiting,
    find_recording,
    list_holds,
)
from shm.store.rows import ON_THE_WAY
from shm.store.tests import list_baseline_tests
from shm.store.watch import (
    list_adoptions,
    list_detections,
    list_selected_models,
)
from shm.values import Hanger, Summary
from shm.values.rounding import ForceUnit, force_unit, rounded_percent
from shm.watch.words.alert_text import watch_words
from shm_cli import flags
from shm_cli.common import opened_store, paragraph, show, show_rows
from shm_cli.held import hold_document
from shm_daemon.heartbeat import duration_words, seconds_since_beat, why_turn_failed
from shm_daemon.spool import scan, unsupported_entries

if TYPE_CHECKING:
    from shm.store import FormerPosterior, FormerTest


_HELD_SHOWN = 5  # layout: the rest by `shm ingest --held`


@click.command()
@click.option(
    "--of", "which", metavar="ID", help="The stages of one recording (by number) or test (by name)."
)
@flags.json
def command(which: str | None) -> None:
    """Show the state of every hanger and of the workspace.

    \b
    Example: shm --workspace arch status
    Example: shm --workspace arch status --of t7
    """
    if which is not None:
        show_stages(which)
        return
    with opened_store() as (workspace, store):
        document = _status(workspace, store)
    if flags.wants_json():
        show(document)
        return
    _show(document)
    for text in document["changed_settings"]:
        click.echo(paragraph(f"changed on the page Settings: {text}"))
    for text in _actions(document["hangers"]):
        click.echo(paragraph(text))
    for row in document["hangers"]:
        if row["creep_per_year"] is not None:
            click.echo(f"hanger {row['hanger']}: {row['creep_per_year']['words']}")
        if row["gap"] is not None:
            click.echo(f"hanger {row['hanger']}: {row['gap']['said']}")
        for text in row["warnings"]:
            rest = text.removeprefix(f"{row['state']} {row['action']}").strip()
            if rest:
                click.echo(paragraph(f"hanger {row['hanger']}: check: {rest}"))
        if row["dated_by_receipt"]:
            undated = dated_by_receipt(row["dated_by_receipt"])
            click.echo(paragraph(f"hanger {row['hanger']}: {undated}"))
        if row["left_out"]:
            text = "; ".join(row["left_out"])
            click.echo(paragraph(f"hanger {row['hanger']}: left out of its baseline: {text}"))
    for row in document["controls"]:
        click.echo(paragraph(f"{row['state']} {row['action']}"))
    for row in document["structures"]:
        click.echo(paragraph(_structure_line(row)))


def _show(document: dict[str, Any]) -> None:
    recordings = ", ".join(f"{n} {stage}" for stage, n in document["recordings"].items() if n)
    daemon, deliveries, now = document["daemon"], document["deliveries"], utc_now()
    ago = (
        f", last seen {duration_words(now - daemon['seen_at'])} ago"
        if daemon["seen_at"]
        else ", never seen"
    )
    oldest = document["oldest_waiting_at"]
    since = f", the oldest since {oldest:%Y-%m-%d %H:%M}" if oldest else ""
    owed = ", ".join(f"{n} {state}" for state, n in deliveries.items() if n)
    text = document["message"]
    parts = (text["state"], text["action"], *text["notes"], text["others"])
    click.echo(paragraph(" ".join(part for part in parts if part)))
    click.echo(f"{document['bridge']}: recordings: {recordings or 'none yet'}")
    click.echo(f"daemon: {daemon['active'] or 'none active'}{ago}")
    if daemon["failed"]:
        click.echo(paragraph(f"its last turn failed: {daemon['failed']}"))
    click.echo(f"waiting: {document['spool']} in the spool, {document['under_way']} stored{since}")
    if document["never_taken"]:
        named = ", ".join(f"{one['path']} ({one['what']})" for one in document["never_taken"][:5])
        click.echo(f"never taken from the spool: {len(document['never_taken'])}: {named}")
    click.echo(f"in quarantine: {document['quarantine']}")
    if document["held"]:
        click.echo(f"held until you decide: {len(document['held'])}; see `shm ingest --held`")
    click.echo(
        f"alerts: {document['alerts']}, {document['open_alerts']} open; "
        f"deliveries: {owed or 'none'}"
    )
    lines = (document[key] for key in ("quiet_hours", "silences", "streams", "publications"))
    for text in chain.from_iterable(lines):
        click.echo(text)
    click.echo(f"disk: {document['disk_free_bytes'] / 1e9:.1f} GB free; more: `shm doctor`")
    _show_hangers(document)
    for each in document["held"][:_HELD_SHOWN]:
        text = f"held, hanger {each['hanger']}: recording {each['recording']}: {each['message']}"
        click.echo(paragraph(text))


def _show_hangers(document: dict[str, Any]) -> None:
    known = [row["averaged"]["tension_n"]["mean"] for row in document["hangers"] if row["averaged"]]
    unit = force_unit(*known)
    headings = (
        "hanger", "state", f"tension, {unit.name}", "since baseline", "tests", "held", "latest",
        "baseline since", "open alerts",
    )  # fmt: skip
    show_rows("hangers", headings, [_cells(row, unit) for row in document["hangers"]])


def _cells(row: Mapping[str, Any], unit: ForceUnit) -> tuple[str, ...]:
    latest, since, change = row["latest_test"], row["baseline_since"], row["change"]
    return (
        str(row["hanger"]),
        Status[row["status"].upper()].value if row["status"] else _untested(row),
        _tension(row, unit),
        rounded_percent(change["mean"], (change["high"] - change["low"]) / 2, "+")
        if change
        else "",
        str(row["tests"]),
        str(row["held"] or ""),
        f"{latest:%Y-%m-%d}" if latest else "none",
        f"{since:%Y-%m-%d}" if since else "none yet",
        str(row["open_alerts"] or ""),
    )


def _untested(row: Mapping[str, Any]) -> str:
    return "no result yet" if row["tests"] else "no test yet"


def _tension(row: Mapping[str, Any], unit: ForceUnit) -> str:
    if row["averaged"] is None:
        return ""
    tension_n = Interval.of_summary(Summary(**row["averaged"]["tension_n"]))
    if tension_n.is_wide:
        return "not determined"
    return with_half(tension_n, unit).removesuffix(f" {unit.name}")


def _structure_line(row: Mapping[str, Any]) -> str:
    latest, since = row["latest_test"], row["baseline_since"]
    name = f" ({row['name']})" if row["name"] else ""
    line = f"structure {row['structure']}{name}: {row['tests']} tests"
    line += f", the latest {latest:%Y-%m-%d %H:%M}" if latest else ""
    line += f", baseline since {since:%Y-%m-%d}" if since else ", no baseline yet"
    undated = dated_by_receipt(row["dated_by_receipt"])
    return f"{line}, {row['open_alerts']} open alerts. {row['said']} {undated}".rstrip()


def _gap(store: Store, hanger: int) -> dict[str, Any] | None:
    """Return the gap since an effect was adopted; None if none is."""
    # It brings the whole pipeline, and of few hangers an effect is adopted.
    from shm.pipeline.adopting import gap_watch

    watch = gap_watch(store, hanger)
    if watch is None:
        return None
    return {
        "before_percent": watch.adopted.adoption.gap_before_percent,
        "adopted_percent": watch.adopted.adoption.gap_percent,
        "now_percent": watch.now_percent,
        "has_grown": watch.has_grown,
        "said": str(watch),
    }


def _actions(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what each hanger needs."""
    return [
        " ".join((row["state"], row["action"], *row["notes"]))
        for row in rows
        if row["urgency"] != "none" and row["tests"]
    ]


def _status(workspace: Workspace, store: Store) -> dict[str, Any]:
    counts, deliveries = count_stages(store), count_deliveries(store)
    held, now = list_holds(store), utc_now()
    state = HangersNow(workspace, store, workspace.bridge.hangers, now)
    open_at = Counter(state.open_alerts)
    lines = {each.id: state.summary(each) for each in workspace.bridge.hangers}
    of_hangers = Counter(hold.hanger for hold in held)
    message = bridge_message({id_: each.message for id_, each in lines.items()})
    return {
        "bridge": workspace.bridge.name,
        "daemon": _daemon(workspace),
        "recordings": counts,
        "under_way": sum(counts[stage] for stage in ON_THE_WAY),
        "oldest_waiting_at": find_oldest_waiting(store),
        "spool": len(scan(workspace.spool)),
        "never_taken": [
            {"path": str(path.relative_to(workspace.spool)), "what": what}
            for path, what in sorted(unsupported_entries(workspace.spool).items())
        ],
        "quarantine": sum(1 for _ in workspace.quarantine.folder.glob("*.reason.json")),
        "alerts": count_raised(store),
        "open_alerts": open_at.total(),
        "deliveries": deliveries,
        "waiting_deliveries": deliveries[DeliveryState.WAITING],
        "quiet_hours": _quiet(workspace, store, now),
        "silences": [
            describe_silence(each) for each in store.silences.list_all() if each.is_in_force(now)
        ],
        "streams": [each.words for each in stream_leads(state.streams)],
        "publications": [
            f"publish {each.name}: {words}"
            for each in workspace.bridge.publications
            if (words := PointOutbox(workspace.folder).state(each.name).words)
        ],
        "disk_free_bytes": shutil.disk_usage(workspace.folder).free,
        "held": [hold_document(hold) for hold in held],
        "changed_settings": [str(each) for each in store.settings.list_current().values()],
        "controls": [chart_document(each) for each in state.charts],
        "structures": _structures(workspace, store, state),
        "message": {**message.document, "others": message.others},
        "hangers": _hangers(workspace, store, state, lines, of_hangers),
    }


def _quiet(workspace: Workspace, store: Store, now: datetime) -> list[str]:
    waits = Counter(
        f"{each.hook} waits until {until:%H:%M %Z}"
        for each in store.alerts.list_deliveries(DeliveryState.WAITING)
        if (until := quiet_until(each, workspace.bridge.hooks, now))
    )
    return [f"{reason}: {count}" for reason, count in waits.items()]


def _daemon(workspace: Workspace) -> dict[str, Any]:
    seen_s = seconds_since_beat(workspace)
    seen_at = None if seen_s is None else utc_now() - timedelta(seconds=seen_s)
    failed = why_turn_failed(workspace) or None
    return {"active": workspace.holder(), "seen_at": seen_at, "failed": failed}


def _structures(workspace: Workspace, store: Store, state: HangersNow) -> list[dict[str, Any]]:
    """Show structures without a model, of which only frequencies are watched."""
    rows = []
    for each in workspace.bridge.structures:
        found, baseline = state.tests.get(each.id), store.watch.baseline(each.id)
        of_baseline = list_baseline_tests(store, baseline) if baseline else ()
        watched = list_detections(store, baseline.hanger, baseline.id) if baseline else ()
        rows.append(
            {
                "structure": each.id,
                "name": each.name,
                "tests": found.tests if found else 0,
                "latest_test": found.time if found else None,
                "baseline_since": min((test.time for test in of_baseline), default=None),
                "open_alerts": state.open_alerts.get(each.id, 0),
                "said": watch_words([one.watched for one in watched], each),
                "dated_by_receipt": list(state.undated.get(each.id, ())),
            }
        )
    return rows


def _hangers(
    workspace: Workspace,
    store: Store,
    state: HangersNow,
    lines: Mapping[int, HangerSummary],
    held: Mapping[int, int],
) -> list[dict[str, Any]]:
    models, rows, adoptions = list_selected_models(store), [], list_adoptions(store)
    for hanger in workspace.bridge.hangers:
        found, baseline = state.tests.get(hanger.id), state.baselines.get(hanger.id)
        watch = state.watches.get(hanger.id)
        adopted = [a.adoption.model for a in adoptions if a.adoption.hanger == hanger.id]
        gap = _gap(store, hanger.id) if adopted else None
        check = baseline.check if baseline else None
        names, reasons = _applicable(hanger, [*workspace.settings.model_names, *adopted])
        rows.append(
            {
                "hanger": hanger.id,
                **lines[hanger.id].document,
                "tests": found.tests if found else 0,
                "latest_test": found.time if found else None,
                "model": models.get(hanger.id),
                "competing": list(names),
                "not_applicable": reasons,
                "baseline_set_at": baseline.set_at if baseline else None,
                "baseline_since": baseline.begins_at if baseline else None,
                "creep_per_year": creep_document(watch.watched.creep_per_year if watch else None),
                "open_alerts": state.open_alerts.get(hanger.id, 0),
                "held": held[hanger.id],
                "warnings": list(lines[hanger.id].warnings),
                "dated_by_receipt": list(lines[hanger.id].undated),
                "left_out": list(check.left_out) if check else [],
                "gap": gap,
            }
        )
    return rows


def _applicable(hanger: Hanger, names: Sequence[str]) -> tuple[Sequence[str], dict[str, str]]:
    """Return the competing model classes, and why others do not apply; for JSON alone."""
    if not flags.wants_json():
        return (), {}
    from shm.models import applicable  # it opens all classes: a fifth of the command's time

    return applicable(hanger, names)


_OUT = (Decision.DISCARDED, Decision.WITHDRAWN)
_OF_STEP = ("at", "version", "test_id", "test")


def show_stages(which: str) -> None:
    """Print the stages of a recording or test; raises NothingThere where there is none."""
    with opened_store() as (_, store):
        recording_id, _ = find_recording(store, which)
        recording = store.recordings.get(recording_id)
        steps, tests = (
            list_steps(store, recording_id),
            list_former_tests(store, recording_id),
        )
        noticed = list_events(store, recording_id=recording_id)
        names = dict.fromkeys(event.subject for event in noticed)
        other_names = [name for name in names if name != recording.file.file_name]
    if flags.wants_json():
        show(
            {
                "recording": recording_id,
                "file": recording.file.file_name,
                "also_came_as": other_names,
                "stage": recording.stage.value,
                "steps": [
                    {"stage": e.kind, **{name: getattr(e, name) for name in _OF_STEP}}
                    for e in steps
                ],
                "noticed": [
                    {"at": event.at, "kind": event.kind, "message": event.message}
                    for event in noticed
                ],
                "results": [asdict(test) for test in tests],
            },
            "recording_stages",
        )
        return
    also = f" (also came as {', '.join(other_names)})" if other_names else ""
    title = f"recording {recording_id}: {recording.file.file_name}{also}"
    by_a_person = {event.at: event.kind for event in noticed if event.kind in _OUT}
    rows = [
        (by_a_person.get(e.at, e.kind), e.test or "", f"{e.at:%Y-%m-%d %H:%M:%S}", e.version or "")
        for e in steps
    ]
    show_rows(title, ("stage", "test", "at", "shm"), rows)
    for event in noticed:
        if event.message:
            kind = "" if event.message.startswith(event.kind) else f"{event.kind}: "
            line = f"{event.at:%Y-%m-%d %H:%M:%S} {kind}{event.message}"
            click.echo(paragraph(line))
    for test in tests:
        click.echo(f"{test.name}: identified by shm {test.lineage.version}{_until(test)}")
        for made in test.posteriors:
            click.echo(f"  posterior of {made.model} by shm {made.lineage.version}{_until(made)}")


def _until(result: FormerTest | FormerPosterior) -> str:
    superseded_at = result.superseded_at
    return f", superseded {superseded_at:%Y-%m-%d %H:%M:%S}" if superseded_at else ""
