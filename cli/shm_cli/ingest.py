"""`shm ingest`: files through the same path as the daemon's, or a look into them.

What is in a file, or in each file of a test, by headers alone: `shm ingest --peek`.
"""

from __future__ import annotations

import logging
import math
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import rich_click as click

from shm.documents import alert_document
from shm.errors import BadInput, ShmError, StoreError, UsageError
from shm.pipeline import Flow
from shm.read import Peek, PeekChannel, bundle
from shm.read.sandbox import load_modes, peek_test
from shm.store import (
    RERUN_STAGES,
    Decision,
    Outcome,
    Receipt,
    Stage,
    Store,
    StoredRecording,
    Workspace,
)
from shm.store.archive import refuse_oversize
from shm.store.recordings import find_discard
from shm.values import Alert
from shm_cli import flags
from shm_cli.common import is_workspace, open_workspace, show, show_rows
from shm_cli.held import decide, decided_words, discarded_words, hold_document, show_held
from shm_cli.working import finish, rerun_document, send_back, working


@click.command()
@click.argument("files", nargs=-1, type=flags.FILE, metavar="FILE...")
@click.option(
    "--together", is_flag=True, help="The files are one test: hits, or set-ups; kept as one .zip."
)
@click.option("--peek", "look", is_flag=True, help="Only show what is in the files.")
@click.option(
    "--again",
    metavar="ID",
    help="Instead of files: do a recording (by number) or a test (by name) again.",
)
@click.option(
    "--from",
    "stage",
    type=click.Choice([stage.value for stage in RERUN_STAGES]),
    help="With --again: the first stage that is done again.  [default: identified]",
)
@click.option("--held", is_flag=True, help="Instead of files: show what is held, and why.")
@click.option(
    "--confirm",
    metavar="ID",
    help="Instead of files: what is held, or was discarded, counts from now on.",
)
@click.option(
    "--discard",
    metavar="ID",
    help="Instead of files: what is held, or counts already, is not to count.",
)
@click.option("--time", type=flags.Time(), help="With --confirm: the true time of the test.")
@click.option("--why", type=flags.Words(), help="With --confirm or --discard: for the record.")
@click.option("--who", show_default="the user's name", help="With --confirm or --discard.")
@flags.json
@click.pass_context
def command(
    ctx: click.Context,
    /,
    files: tuple[Path, ...],
    together: bool,
    look: bool,
    **about: Any,
) -> int:
    """Take in files of known loggers; --peek looks, --again redoes.

    A logger that shm has not seen before needs answers: use `shm import FILE` for its first file.

    Each file is archived, identified, updated and watched as the daemon would do it; it may also be
    a *.modes.json. The files stay where they are. Exit code 3 if any was refused.

    An implausible recording is held and not used: --held lists them, --confirm and --discard
    decide. With --why they also exclude a used recording, or take back a discarded one.

    \b
    Example: shm ingest hanger3_*.csv
    Example: shm ingest --again t7 --from updated
    Example: shm ingest --confirm 12 --time 2026-05-01T10:00Z --why "clock was dead"
    """
    _refuse_mixture(files, about, together or look)
    if look:
        return show_peeks(files, open_workspace() if is_workspace() else None)
    logging.getLogger("shm").addHandler(logging.NullHandler())  # all is said in the table
    workspace = open_workspace()
    if about["held"]:
        return show_held(workspace)
    if about["confirm"] or about["discard"]:
        return _decide(workspace, about)
    if about["again"] is not None:
        stage = Stage(about["stage"] or Stage.IDENTIFIED)
        return _again(workspace, about["again"], stage)
    if together:
        folder = Path(ctx.with_resource(TemporaryDirectory()))
        most = workspace.settings.max_file_bytes
        refuse_oversize(sum(path.stat().st_size for path in files), most)
        files = (bundle(files, folder / f"{files[0].stem}.zip"),)
    with workspace.store() as store:
        known = {stored.id for stored in store.alerts.list_all()}
        receipts, unreadable = _ingest(workspace, files)
        rows = [_row_of(store, path, receipt) for path, receipt in receipts.items()]
        raised = [stored.alert for stored in store.alerts.list_all() if stored.id not in known]
    _show(rows + unreadable, raised)
    refused = any(row["outcome"] == _REFUSED for row in rows + unreadable)
    return BadInput.exit_code if refused else 0


_INSTEAD = ("again", "held", "confirm", "discard")
_GOES_WITH = {
    "stage": ("--from", ("again",)),
    "time": ("--time", ("confirm",)),
    "why": ("--why", ("confirm", "discard")),
    "who": ("--who", ("confirm", "discard")),
}


def _refuse_mixture(files: Sequence[Path], about: Mapping[str, Any], about_files: bool) -> None:
    chosen = [name for name in _INSTEAD if about[name] not in (None, False)]
    if not chosen and not files:
        raise UsageError(
            "no file is named.", remedy="Give FILE..., --again ID, --held, --confirm or --discard."
        )
    for name, (option, owners) in _GOES_WITH.items():
        if about[name] is not None and not set(chosen) & set(owners):
            needed = " or ".join(f"--{owner}" for owner in owners)
            raise UsageError(f"{option} goes with {needed}.", remedy=f"Give {needed} ID as well.")
    if len(chosen) > 1:
        raise UsageError(
            f"--{chosen[0]} and --{chosen[1]} at once.", remedy="Give one after the other."
        )
    if chosen and (files or about_files):
        raise UsageError(
            f"--{chosen[0]} takes no files.", remedy=f"Give either FILE... or --{chosen[0]}."
        )


def _decide(workspace: Workspace, about: Mapping[str, Any]) -> int:
    decision = Decision.CONFIRMED if about["confirm"] else Decision.DISCARDED
    which, record = about["confirm"] or about["discard"], (about["who"], about["why"])
    made = decide(workspace, which, decision, record, about["time"])
    with workspace.store() as store:
        stage = store.recordings.get(made.hold.recording_id).stage
    if flags.wants_json():
        alerts = [alert_document(stored.alert) for stored in made.alerts]
        show({**hold_document(made.hold), "stage": stage.value, "alerts": alerts}, "decision")
        return 0
    click.echo(decided_words(made, stage))
    for stored in made.alerts:
        click.echo(f"Alert: {stored.alert.message}", err=True)
    return 0


def _again(workspace: Workspace, which: str, stage: Stage) -> int:
    with workspace.store() as store:
        known = {stored.id for stored in store.alerts.list_all()}
        rerun = send_back(workspace, which, stage)
        recording = store.recordings.get(rerun.recording.id)
        row = _row(Path(recording.file.file_name), Outcome.REOPENED, recording)
        raised = [stored.alert for stored in store.alerts.list_all() if stored.id not in known]
    _show([row], raised, again=rerun_document(rerun, stage))
    return BadInput.exit_code if row["outcome"] == _REFUSED else 0


def _ingest(
    workspace: Workspace, files: Sequence[Path]
) -> tuple[dict[Path, Receipt], list[dict[str, object]]]:
    """Return receipts of the files taken in, and rows of the refused ones."""
    with working(workspace) as flow:
        receipts, unreadable = _received(flow, files)
        finish(flow, [receipt.recording.id for receipt in receipts.values()])
    return receipts, unreadable


def _received(
    flow: Flow, files: Sequence[Path]
) -> tuple[dict[Path, Receipt], list[dict[str, object]]]:
    receipts: dict[Path, Receipt] = {}
    unreadable: list[dict[str, object]] = []
    for path in files:
        try:
            receipts[path] = flow.receive(path)
        except StoreError:
            raise
        except (ShmError, OSError) as error:
            unreadable.append(
                {"file": path.name, "outcome": _REFUSED, "stage": None, "reason": str(error)}
            )
    return receipts, unreadable


def _row_of(store: Store, path: Path, receipt: Receipt) -> dict[str, object]:
    row = _row(path, receipt.outcome, store.recordings.get(receipt.recording.id))
    hold = find_discard(store, receipt.recording.id)
    if receipt.outcome is Outcome.DISCARDED and hold is not None:
        row |= {"outcome": Outcome.DISCARDED.value, "reason": discarded_words(hold)}
    return row


def _row(path: Path, outcome: Outcome, recording: StoredRecording) -> dict[str, object]:
    ended = {Stage.REFUSED: _REFUSED, Stage.HELD: "held"}
    return {
        "file": path.name,
        "known_as": recording.file.file_name,
        "outcome": ended.get(recording.stage, _OUTCOMES[outcome]),
        "stage": recording.stage.value,
        "hanger": recording.hanger,
        "sha256": recording.file.sha256,
        "reason": _sentence(recording.reason) if recording.reason else None,
    }


_REFUSED = "refused"


def _sentence(reason: Mapping[str, Any]) -> str:
    """Return line and channel where known, the error and the remedy."""
    line = f"line {reason['line']}: " if reason["line"] is not None else ""
    channel = f"channel {reason['channel']}: " if reason["channel"] else ""
    return f"{line}{channel}{reason['message']} {reason['remedy']}".strip()


_OUTCOMES = {
    Outcome.NEW: "taken in",
    Outcome.RESUMED: "taken in",
    Outcome.DUPLICATE: "known already",
    Outcome.REOPENED: "tried again",
    Outcome.DISCARDED: Outcome.DISCARDED.value,
    Outcome.REDESCRIBED: "done again",
}


def _show(rows: Sequence[dict[str, object]], raised: Sequence[Alert], **more: object) -> None:
    if flags.wants_json():
        alerts = [alert_document(alert) for alert in raised]
        show({"files": list(rows), "alerts": alerts, **more})
        return
    keys = ("file", "outcome", "hanger", "stage")
    values = [[row.get(key) for key in keys] for row in rows]
    show_rows("ingested", keys, [["" if e is None else str(e) for e in row] for row in values])
    for row in rows:
        if row["reason"]:
            click.echo(f"{row['file']}: {row['reason']}", err=True)
    for alert in raised:
        if "held" not in alert.kinds:  # told beside its file
            click.echo(f"Alert: {alert.message}", err=True)


_MODES_SUFFIX = ".modes.json"


def show_peeks(files: Sequence[Path], workspace: Workspace | None = None) -> int:
    """Show what is in files, as a workspace would take them in by their loggers' profiles.

    The exit code is 3 where one cannot be read, its headers have faults, or something is missing.
    """
    looks = [look for path in files for look in _looks(path, workspace)]
    missing = [_missing(look, workspace) for look in looks]
    if flags.wants_json():
        found = zip(looks, missing, strict=True)
        files_found = [{**asdict(look), "missing": lacks} for look, lacks in found]
        show({"files": files_found}, "peek")
    else:
        for look, lacks in zip(looks, missing, strict=True):
            if look.channels:
                _show_channels(look)
            else:
                click.echo(_title(look))
            if look.left_out:
                click.echo(f"left out: {', '.join(look.left_out)}")
            for problem in look.problems:
                click.echo(f"problem: {problem}", err=True)
            if lacks:
                click.echo(f"missing: {'; '.join(lacks)}: {_say_it(look)}", err=True)
    is_lacking = any(missing) or any(look.problems for look in looks)
    return BadInput.exit_code if is_lacking else 0


def _looks(path: Path, workspace: Workspace | None) -> Sequence[Peek]:
    """Return a file that cannot be read as one with a problem and no channels."""
    try:
        if path.name.lower().endswith(_MODES_SUFFIX):
            return [_modes(path)]
        return peek_test(path) if workspace is None else _by_profile(path, workspace)
    except BadInput as error:
        return [Peek(str(path), "not readable", (), 0, problems=(str(error),))]


def _by_profile(path: Path, workspace: Workspace) -> Sequence[Peek]:
    """Look into a file that is completed by its logger's profile, under its own name."""
    from shm.pipeline.intake import as_taken_in

    with as_taken_in(path, workspace) as taken:
        looks = peek_test(taken)
    return looks if taken == path else [replace(look, source=str(path)) for look in looks]


def _missing(look: Peek, workspace: Workspace | None) -> list[str]:
    """List what no file may lack: planes of its sensors, its day and, in a workspace, its hanger.

    A structure without a model needs no planes.
    """
    structures = workspace.bridge.structures if workspace is not None else ()
    needs_planes = look.hanger not in [each.id for each in structures]
    sensors = [each for each in look.channels if each.quantity == "acceleration"]
    bare = [each.name for each in sensors if each.plane is None] if needs_planes else []
    days = [] if look.time else [f"{each:%Y-%m-%d}" for each in look.possible_times]
    lacks = {
        "hanger": workspace is not None and bool(sensors) and look.hanger is None,
        f"plane of {', '.join(bare)}": bool(bare),
        f"which day, {' or '.join(days)}": bool(days),
    }
    return [what for what, is_missing in lacks.items() if is_missing]


def _say_it(look: Peek) -> str:
    source = Path(look.source)  # a member of an archive, or a record of a file, lies below it
    file = next((each for each in (source, *source.parents) if each.is_file()), source)
    return f"run `shm import {shlex.quote(str(file))}`"


def _modes(path: Path) -> Peek:
    tests = load_modes(path)
    channels = tuple(PeekChannel(f"{test.id}: {len(test.modes)} modes", None) for test in tests)
    first = tests[0]
    return Peek(
        str(path),
        "modal tests",
        channels,
        0,
        hanger=first.hanger,
        time=first.time,
        temperature_c=first.temperature_c,
    )


def _show_channels(look: Peek) -> None:
    """Return a row a channel; calibration and full scale only where a channel has one."""
    columns = {
        name: cells
        for name, cell_of in _COLUMNS.items()
        if any(cells := [cell_of(channel) for channel in look.channels]) or name not in _RARE
    }
    show_rows(_title(look), tuple(columns), zip(*columns.values(), strict=True))


def _number(value: float) -> str:
    return f"{value:g}" if math.isfinite(value) else ""


_COLUMNS: dict[str, Callable[[PeekChannel], str]] = {
    "channel": lambda channel: channel.name,
    "quantity": lambda channel: channel.quantity or "",
    "unit": lambda channel: channel.unit,
    "plane": lambda channel: channel.plane or "",
    "x (m)": lambda channel: _number(channel.x_m),
    "calibration": lambda channel: _number(channel.calibration),
    "full scale": lambda channel: _number(channel.full_scale),
}
_RARE = ("calibration", "full scale")


def _title(look: Peek) -> str:
    rate = look.sampling_rate_hz
    parts = (
        f"{look.source}: {look.format}",
        _kind(look),
        f"hanger {look.hanger}" if look.hanger is not None else "hanger not named",
        f"{look.time:%Y-%m-%d %H:%M} UTC" if look.time else "time not recorded",
        f"{look.temperature_c:g} °C" if math.isfinite(look.temperature_c) else "",
        f"{look.samples} samples" if look.samples else "",
        f"{look.samples / rate:.1f} s at {rate:g} Hz" if math.isfinite(rate) else "",
    )
    return ", ".join(part for part in parts if part)


def _kind(look: Peek) -> str:
    """Return the kind of file, if it is not a single hammer test."""
    if look.lines:
        return f"frequency responses of {look.lines} lines every {look.frequency_step_hz:g} Hz"
    ambient = look.samples and all(channel.quantity == "acceleration" for channel in look.channels)
    return "ambient (no hammer force)" if ambient else ""
