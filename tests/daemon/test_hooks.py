"""Command hooks: a fixed command, JSON on standard input, a bare environment, a time limit."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
import tracemalloc
from dataclasses import replace
from pathlib import Path

import pytest

from shm.bridge import CommandHook
from shm_daemon import HookFailed, HookNotifier
from tests.helpers.nouns import an_alert

ENVIRONMENT = {"PATH": os.environ["PATH"], "HOME": "/home/owner", "SHM_SECRET": "token"}


def python(code: str, *arguments: str) -> CommandHook:
    return CommandHook("mail", (sys.executable, "-c", code, *arguments))


def a_notifier(tmp_path: Path, timeout_s: float = 20.0) -> HookNotifier:
    return HookNotifier(tmp_path, timeout_s, ENVIRONMENT)


def test_a_hook_gets_the_alert_on_its_standard_input(tmp_path: Path) -> None:
    code = "import sys; open('told.json', 'w').write(sys.stdin.read())"
    a_notifier(tmp_path)(python(code), an_alert())
    told = json.loads((tmp_path / "told.json").read_text())
    assert told["schema"] == "shm.alert/1"
    assert told["key"] == "hanger-3:tension-down"
    assert told["time"] == "2026-05-01T12:00:00Z"
    assert told["drifts"][0]["quantity"] == "tension"


def test_message_to_hook_has_no_backticks(tmp_path: Path) -> None:
    code = "import sys; open('told.json', 'w').write(sys.stdin.read())"
    message = "Hanger 3: lost. Compare the hangers beside it (`shm drift bridge`) today."
    a_notifier(tmp_path)(python(code), replace(an_alert(), message=message))
    told = json.loads((tmp_path / "told.json").read_text())
    assert told["message"] == message.replace("`", "")
    assert told["action"] == "Compare the hangers beside it (shm drift bridge) today."


def test_a_hooks_environment_is_bare_and_names_the_alert(tmp_path: Path) -> None:
    code = "import json, os; json.dump(dict(os.environ), open('env.json', 'w'))"
    a_notifier(tmp_path)(python(code), an_alert())
    seen = json.loads((tmp_path / "env.json").read_text())
    assert seen.pop("SHM_ALERT_KEY") == "hanger-3:tension-down"
    seen.pop("LC_CTYPE", None)  # the interpreter's own doing
    assert seen == {"PATH": ENVIRONMENT["PATH"], "HOME": "/home/owner"}


def test_arguments_are_never_read_by_a_shell(tmp_path: Path) -> None:
    argument = "$(touch oops); `touch oops` | touch oops"
    code = "import sys; open('argument', 'w').write(sys.argv[1])"
    a_notifier(tmp_path)(python(code, argument), an_alert())
    assert (tmp_path / "argument").read_text() == argument
    assert not (tmp_path / "oops").exists()


def test_a_hook_that_fails_says_why(tmp_path: Path) -> None:
    with pytest.raises(HookFailed, match="exit code 3: mail server is away"):
        a_notifier(tmp_path)(
            python("import sys; print('mail server is away', file=sys.stderr); sys.exit(3)"),
            an_alert(),
        )


@pytest.mark.parametrize("command", [("/no/such/program",), ("/",)])
def test_a_hook_that_cannot_be_run_says_so(tmp_path: Path, command: tuple[str, ...]) -> None:
    with pytest.raises(HookFailed, match="cannot be run"):
        a_notifier(tmp_path)(CommandHook("mail", command), an_alert())


def test_an_alert_links_to_the_page_that_it_is_about(tmp_path: Path) -> None:
    notifier = HookNotifier(tmp_path, 30.0, ENVIRONMENT, "https://shm.example.org/")
    told = python("import json, sys; print(json.load(sys.stdin).get('link', 'none'))")
    assert notifier(told, an_alert()).endswith("https://shm.example.org/hangers/3#alerts")
    assert a_notifier(tmp_path)(told, an_alert()).endswith("none")


def test_a_hook_that_hangs_is_ended_with_all_its_children(tmp_path: Path) -> None:
    code = (
        "import subprocess, time; child = subprocess.Popen(['sleep', '60']);"
        "open('child', 'w').write(str(child.pid)); time.sleep(60)"
    )
    with pytest.raises(HookFailed, match="ended after 1 s"):
        a_notifier(tmp_path, timeout_s=1.0)(python(code), an_alert())
    assert is_gone(int((tmp_path / "child").read_text()))


def test_hook_output_needs_no_disk(tmp_path: Path) -> None:
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 20, 1 << 20));"
        "[each.write('x' * (1 << 20)) for each in (sys.stdout, sys.stderr) for _ in range(20)];"
        "print('the end')"
    )
    tracemalloc.start()
    try:
        answer = a_notifier(tmp_path)(python(code), an_alert())
        peak_bytes = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert answer.endswith("xthe end")
    assert peak_bytes < 2**20


def test_closing_ends_running_hooks_and_begins_no_more(tmp_path: Path) -> None:
    notifier, failures = a_notifier(tmp_path), []

    def deliver() -> None:
        try:
            notifier(python("open('begun', 'w'); import time; time.sleep(60)"), an_alert())
        except HookFailed as error:
            failures.append(error.message)

    thread = threading.Thread(target=deliver)
    thread.start()
    while not (tmp_path / "begun").exists():
        time.sleep(0.01)
    notifier.close()
    thread.join(120)
    assert not thread.is_alive()
    assert "exit code -9" in failures[0]
    with pytest.raises(HookFailed, match="ending"):
        notifier(CommandHook("mail", ("true",)), an_alert())


def is_gone(pid: int, seconds: float = 120.0) -> bool:
    """Return True once a process has ended; one that nobody has buried yet counts."""
    status = Path(f"/proc/{pid}/stat")
    for _ in range(int(seconds / 0.05)):
        try:
            if status.read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except OSError:
            return True
        time.sleep(0.05)
    return False
