"""No verb lets text that others wrote reach the terminal with its control characters."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import click
import pytest
from rich.text import Text

from shm.pipeline import utc_now
from shm.store import Workspace
from shm.store.journal import Actor
from shm.store.rows import Role, Scope
from shm.values.notes import NoteKind
from shm_cli.terminal import Terminal, escape_controls
from tests.cli.conftest import Shm
from tests.helpers.command_lines import commands
from tests.helpers.streams import an_event, with_stream
from tests.helpers.taken_in import ingest_quickly, with_a_loss
from tests.helpers.workspaces import write_held, write_test

TURNING = [chr(code) for code in (*range(0x202A, 0x202F), *range(0x2066, 0x206A), 0x200E, 0x200F)]
BAD = [chr(code) for code in (*range(32), *range(0x7F, 0xA0)) if chr(code) not in "\t\n"] + TURNING
EVIL = "EVIL\x1b[31m\x1b]8;;http://x\x07\x9b2J\u202etxt\u2066\u200f\u200e\x7f\rno [/] [bold]"

# A line for each verb that shows what is stored, or what a file says.
LINES = (
    "acquire --device {evil} --hammer {evil} --sensor {evil} --hanger 3 --out {out}/a.zip",
    "alerts", "alerts ack 1 --why seen", "alerts resend 1", "alerts silences",
    "alerts silence --hanger 3 --until 2999-01-01 --why {evil}", "alerts unsilence 1",
    "alerts test mail", "archive fetch 1", "archive prune --keep-days 1 --dry-run", "audit",
    "bridges", "db backup {out}/b", "db check", "db check --archive",
    "db copy sqlite:///{out}/c.db", "db upgrade", "doctor", "drift", "drift --hanger 3 --all",
    "drift bridge", "drift rebaseline --hanger 3 --since 2026-05-02 --why {evil}",
    "export --hanger 3 --out {out}/p.csv",
    "gap adopt --hanger 3 --effect added_mass --why {evil}", "gap adopted", "gap check {evil}",
    "gap diagnose {evil}",
    "gap drop --hanger 3 --why {evil}", "gap plan {evil}", "identify {file}", "import {file}",
    "ingest", "ingest --held", "ingest --peek {file}", "ingest {file}", "init {out}/{evil}",
    "note add {evil} --hanger 3 --who {evil}", "note list", "predict beam1 --hanger 3",
    "report --bridge", "report --hanger 3", "report --hanger 3 --format text",
    "select {file} --models beam1", "status", "status --of 1", "status --of {evil}", "stream",
    "stream --events", "stream export h3 2026-05-01 2026-05-02 {out}/x.csv",
    "stream keep h3 2026-05-01 2026-05-02 --why {evil}", "token create {evil}", "token list",
    "token revoke {evil}", "update {file} --model beam1", "user add {evil}", "user list",
    "user password {evil}", "user remove {evil}", "user single-sign-on {evil}", "{evil}",
    "drift {evil}", "report --hanger {evil}", "--workspace {evil} status",
)  # fmt: skip
# They serve or work for long, or print nobody's words but ours.
OTHERS = {
    "daemon", "demo", "web", "simulate", "completion", "db restore", "gap effects",
    "manual", "notices", "settings",
}  # fmt: skip


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Return a bridge whose written texts all hold what no terminal should get."""
    workspace = with_a_loss(tmp_path_factory.mktemp("hostile") / "bridge")
    path = workspace.folder / "bridge.toml"
    named = path.read_text().replace('"Test bridge"', json.dumps(EVIL))
    path.write_text(f'{named}\n[[hook]]\nname = "mail"\ncommand = ["printf", {json.dumps(EVIL)}]\n')
    workspace = with_stream(workspace.reopened())
    write_held(workspace, 4)
    ingest_quickly(workspace)
    (workspace.spool / f"{EVIL.replace('/', '')}.csv").write_text(f"{EVIL}\n")
    now = utc_now()
    with replace(workspace, actor=Actor(EVIL, "page")).store() as store:
        store.notes.add(3, now, NoteKind.NOTE, f"{EVIL}\n{EVIL}", EVIL, now)
        store.journal.note(now, "setting changed", EVIL, EVIL)
        store.alerts.acknowledge(1, EVIL, EVIL, now)
        store.silences.make(3, (now, now + timedelta(days=9)), EVIL, EVIL, now)
        store.recordings.refuse_unread(EVIL, EVIL, now)
        store.streams.save_event(replace(an_event(), start=now, end=now, detail=EVIL, channel=EVIL))
        store.people.add("ann@example.org", Role.READER, None, now)
        store.upkeep.create_token("logger", Scope.READ, now)
    return workspace


def shown(line: str, workspace: Workspace, tmp_path: Path) -> list[str]:
    file = tmp_path / "EVIL\x1b[31m\u202e.modes.json"
    write_test(file, workspace, name="t9")
    return [
        word.format(evil=EVIL, out=tmp_path / "\x9bout", file=file)
        for word in ("--workspace {w} " + line).replace("{w}", str(workspace.folder)).split()
    ]


@pytest.mark.parametrize("line", LINES)
def test_no_controls(
    shm: Shm, hostile: Workspace, tmp_path: Path, line: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    for more in ((), ("--json",)):
        monkeypatch.setattr("sys.stdin", io.StringIO("correct horse battery\n"))
        ended = shm(*shown(line, hostile, tmp_path), *more)
        assert "Unexpected" not in ended.err
        assert sorted({*ended.out, *ended.err} & {*BAD}) == []


@pytest.mark.parametrize("line", ["note list", "audit", "stream --events", "alerts silences"])
def test_escaped_text_remains_readable(
    shm: Shm, hostile: Workspace, line: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "2000")
    out = shm("--workspace", hostile.folder, *line.split()).out
    assert "EVIL\\u001b[31m" in out
    assert "\\u202etxt" in out
    assert "no [/] [bold]" in out


def test_every_verb_is_tried() -> None:
    typed = {name for name, command in commands() if not needs_member(command)}
    tried = {name for name in typed for line in LINES if line.startswith(name)}
    assert typed - tried == OTHERS


def needs_member(command: click.Command) -> bool:
    return isinstance(command, click.Group) and not command.invoke_without_command


def test_json_keeps_its_meaning(shm: Shm, hostile: Workspace) -> None:
    (note,) = shm("--workspace", hostile.folder, "note", "list", "--json").document["notes"][-1:]
    assert note["text"] == f"{EVIL}\n{EVIL}"


def test_escape_controls_keeps_text() -> None:
    kept = "Brücke 橋 \t\u0646\u200c\u0647\nm/s² 👩\u200d🔧 3\u202f%\r\n"
    assert escape_controls(kept) == kept
    for each in BAD:
        escaped = escape_controls(f"a{each}b")
        assert escaped.isprintable()
        assert json.loads(f'"{escaped}"') == f"a{each}b"


def test_terminal_keeps_own_colours() -> None:
    written = io.StringIO()
    terminal = Terminal(file=written, force_terminal=True, color_system="standard", highlight=False)
    terminal.print("[bold]Error:[/] \x1b[31m", Text("\x9b2J\u202e", style="red"))
    assert written.getvalue() == (
        "\x1b[1mError:\x1b[0m \\u001b[31m \x1b[31m\\u009b2J\\u202e\x1b[0m\n"
    )
