"""A daemon that is killed again and again, a hook that fails half the time: is every alert told?

    python tests/benchmarks/alert_delivery.py --alerts 1000 --kills 20

The alerts come in equal parts before each life of the daemon, `python -m shm_daemon` as an owner
begins it, which `kill -9` ends after a random time from the moment that it serves or, in most
lives, that it first delivers. A hook that fails
does so in one of three ways, each of them from a seed: it says that it is busy; it takes the alert
and then ends the connection without an answer; it answers too late. The last two have had the
alert and get it again. With `--hook command` it is a program, which fails by its exit code.

With `--alike 50` there are fifty hangers that move alike instead, one alert each, spread over the
lives, and a hook `chief` that is told of what nobody has acknowledged after so many seconds
(`--escalation`): how many pages there are, whether any alert is lost, how late the escalation is.

    python tests/benchmarks/alert_delivery.py --alike 50 --kills 20

`tests/daemon/test_dead_hooks.py` holds what can be tested in seconds.
"""

from __future__ import annotations

import argparse
import hashlib
import hmac
import json
import random
import sys
import tempfile
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import begin

from shm.pipeline import utc_now
from shm.store import DeliveryState, Workspace
from tests.helpers.daemons import real_daemon, until_serving
from tests.helpers.listeners import Answer, Told, a_listener
from tests.helpers.outboxes import make_baseline, raise_alerts, raise_alike
from tests.helpers.workspaces import make_workspace

SECRET = b"of the benchmark"
SETTINGS = {
    "hook_attempts": 1000,  # so that none is given up: 10 failures in a row are to be expected
    "hook_backoff_seconds": 0.01,
    "hook_timeout_seconds": 1.0,
    "spool_scan_seconds": 0.2,
}
PROGRAM = """
import json, os, random, sys
key, (seed, keys) = json.load(sys.stdin)["key"], sys.argv[1:]
with open(keys, "a+") as file:
    file.seek(0)
    tried = file.read().count(f" {key}\\n")
    way = random.Random(f"{seed} {key} {tried}").choices(("took", "busy", "lost"), (50, 25, 25))[0]
    file.write(f"{way} {key}\\n")
sys.exit(way != "took")
"""


@dataclass
class Receiver:
    """A hook's other end: checks the signature, writes down the keys it gets, fails at times."""

    keys: Path
    seed: int
    tries: Counter[str] = field(default_factory=Counter)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def __call__(self, told: Told) -> Answer:
        key = json.loads(told.body)["key"]
        if not self.is_signed(told) or told.headers["Idempotency-Key"] != key:
            raise SystemExit(f"{key} is not signed as it should be")
        way = self.noted(key)
        if way == "late":
            time.sleep(1.5)
        return Answer(503 if way == "busy" else 200, cut=way == "lost")

    def noted(self, key: str) -> str:
        """How this try is taken, written down before the answer as any receiver must do it."""
        with self.lock:
            rng = random.Random(f"{self.seed} {key} {self.tries[key]}")
            (way,) = rng.choices(("took", "busy", "lost", "late"), (50, 39, 10, 1))
            self.tries[key] += 1
            with self.keys.open("a") as file:
                file.write(f"{way} {key}\n")
        return way

    def is_signed(self, told: Told) -> bool:
        signed = told.headers["X-Shm-Timestamp"].encode() + b"." + told.body
        made = f"sha256={hmac.new(SECRET, signed, hashlib.sha256).hexdigest()}"
        return hmac.compare_digest(made, told.headers["X-Shm-Signature"])


def states(workspace: Workspace) -> Counter[str]:
    with workspace.store() as store:
        return Counter(delivery.state.value for delivery in store.alerts.list_deliveries())


def main() -> None:
    options = begin.options(
        __doc__,
        alerts=1000,
        kills=20,
        longest=begin.Told(2.0, "longest life, in s"),
        hook=("webhook", "command"),
        seed=1,
        alike=begin.Told(0, "hangers that move alike"),
        escalation=begin.Told(120.0, "in s"),
    )
    if options.alike:
        alike(options)
        return
    with tempfile.TemporaryDirectory() as folder:
        keys = Path(folder) / "keys"
        keys.touch()
        with a_listener(Receiver(keys, options.seed)) as listener:
            workspace = described(Path(folder), listener.url, keys, options)
            make_baseline(workspace)
            caught = live_and_be_killed(workspace, keys, options)
            seconds = live_in_peace(workspace)
        judge(workspace, keys, options, caught, seconds)


def described(folder: Path, url: str, keys: Path, options: argparse.Namespace) -> Workspace:
    """A workspace with the one hook `ops`."""
    workspace = make_workspace(folder / "bridge", settings=SETTINGS)
    (workspace.folder / "secret").write_bytes(SECRET)
    hook = f'url = "{url}"\nsecret_file = "secret"'
    if options.hook == "command":
        command = [sys.executable, "-S", "-c", PROGRAM, str(options.seed), str(keys)]
        hook = f"command = {json.dumps(command)}"
    path = Path(workspace.bridge.source)
    path.write_text(f'{path.read_text()}\n[[hook]]\nname = "ops"\n{hook}\n')
    return workspace.reopened()


def live_and_be_killed(workspace: Workspace, keys: Path, options: argparse.Namespace) -> int:
    """All lives that SIGKILL ends; how many of them had deliveries still to make."""
    rng, caught = random.Random(options.seed), 0
    for life in range(options.kills):
        first, last = (round(options.alerts * n / options.kills) + 1 for n in (life, life + 1))
        raise_alerts(workspace, range(first, last), ["ops"])
        with real_daemon(workspace.folder) as daemon:
            until_serving(daemon.pid, workspace.folder)
            if rng.random() < 0.7:  # else it may be killed before it comes to deliver
                until_told(keys)
            time.sleep(rng.uniform(0.0, options.longest))
        counts, tries = states(workspace), len(keys.read_text().splitlines())
        caught += counts["waiting"] > 0
        print(
            f"kill {life + 1}: {tries} tries, " + ", ".join(f"{n} {s}" for s, n in counts.items())
        )
    return caught


def until_told(keys: Path) -> None:
    """Waits until the hook hears of the next alert."""
    size, end = keys.stat().st_size, time.monotonic() + 30
    while keys.stat().st_size == size and time.monotonic() < end:
        time.sleep(0.005)


def live_in_peace(workspace: Workspace) -> float:
    """A last life that ends when nothing is owed; how long that takes, in s."""
    began = time.monotonic()
    with real_daemon(workspace.folder) as daemon:
        until_serving(daemon.pid, workspace.folder)  # before, SIGTERM ends it as any program
        while states(workspace)["waiting"]:
            time.sleep(0.2)
        seconds = time.monotonic() - began
        daemon.terminate()
        if daemon.wait(30) != 0:
            raise SystemExit(f"SIGTERM gave exit code {daemon.returncode}")
    return seconds


def judge(
    workspace: Workspace, keys: Path, options: argparse.Namespace, caught: int, seconds: float
) -> None:
    """Prints the table; ends with an error where an alert was lost or stands unmarked."""
    tries = [line.split() for line in keys.read_text().splitlines()]
    ways = Counter(way for way, _ in tries)
    had = Counter(key for way, key in tries if way != "busy")
    with workspace.store() as store:
        delivered = {
            each.alert.key for each in store.alerts.list_deliveries(DeliveryState.DELIVERED)
        }
        alerts = {each.alert.key for each in store.alerts.list_all()}
        attempts = sum(each.attempts for each in store.alerts.list_deliveries())
    failed = sum(number for way, number in ways.items() if way != "took")
    after_kill = sum(had.values()) - len(had) - ways["lost"] - ways["late"]
    print(f"\n{options.hook}, seed {options.seed}\n\n| | |\n|---|---|")
    for name, value in (
        ("alerts raised", len(alerts)),
        ("kills, of them with deliveries still to make", f"{options.kills}, {caught}"),
        ("tries that the hook saw, of them failed", f"{len(tries)}, {failed / len(tries):.0%}"),
        ("tries that the outbox has counted", attempts),
        ("alerts that the hook had at least once", len(had)),
        ("alerts marked as delivered", len(delivered)),
        ("alerts left unmarked", len(alerts - delivered)),
        ("duplicates", sum(had.values()) - len(had)),
        ("of them because an answer was lost or late", ways["lost"] + ways["late"]),
        ("of them because of a kill before the mark", after_kill),
        ("most often that one alert was had", max(had.values())),
        ("last life, until nothing was owed", f"{seconds:.0f} s"),
    ):
        print(f"| {name} | {value} |")
    if not alerts == delivered == had.keys() or len(alerts) != options.alerts:
        raise SystemExit("an alert was lost, or stands unmarked")


GATHERING_S = 20.0


def alike(options: argparse.Namespace) -> None:
    """Fifty hangers that move alike, lives of a daemon that is killed, and an escalation."""
    rng, pages = random.Random(options.seed), []
    lock = threading.Lock()

    def note(hook: str, told: Told) -> Answer:
        with lock:
            body = json.loads(told.body)
            lost = rng.random() < 0.5
            pages.append((hook, time.time(), body, lost))
        return Answer(200, cut=lost)

    with tempfile.TemporaryDirectory() as folder:
        with (
            a_listener(lambda told: note("ops", told)) as ops,
            a_listener(lambda told: note("chief", told)) as chief,
        ):
            hangers = range(1, options.alike + 1)
            settings = {**SETTINGS, "alert_grouping_seconds": GATHERING_S}
            workspace = make_workspace(Path(folder) / "bridge", hangers=hangers, settings=settings)
            (workspace.folder / "secret").write_bytes(SECRET)
            path, late = Path(workspace.bridge.source), options.escalation
            path.write_text(
                f'{path.read_text()}\n[[hook]]\nname = "ops"\nurl = "{ops.url}"\n'
                f'secret_file = "secret"\n[[hook]]\nname = "chief"\nurl = "{chief.url}"\n'
                f'secret_file = "secret"\nescalation_after_seconds = {late}\n'
            )
            workspace = workspace.reopened()
            began = time.time()
            raise_alike(workspace, hangers, ["ops", "chief"], utc_now())
            for _ in range(options.kills):
                with real_daemon(workspace.folder) as daemon:
                    until_serving(daemon.pid, workspace.folder)
                    time.sleep(rng.uniform(0.0, options.longest))
            live_in_peace(workspace)
        judge_alike(workspace, pages, began, options)


def judge_alike(
    workspace: Workspace,
    pages: list[tuple[str, float, dict[str, Any], bool]],
    began: float,
    options: argparse.Namespace,
) -> None:
    """Prints the table; ends with an error where an alert was lost or an escalation was late."""
    with workspace.store() as store:
        alerts = {each.alert.key: each.raised_at.timestamp() for each in store.alerts.list_all()}
        ended = {each.state.value for each in store.alerts.list_deliveries()}
    had: dict[str, set[str]] = {"ops": set(), "chief": set()}
    keys: dict[str, Counter[str]] = {"ops": Counter(), "chief": Counter()}
    first: dict[str, float] = {}
    for hook, at, body, _ in pages:
        keys[hook][body["key"]] += 1
        inner = [each["key"] for each in body.get("alerts", [])] or [body["key"]]
        had[hook].update(inner)
        if hook == "chief":
            for key in inner:
                first.setdefault(key, at)
    late = [first[key] - alerts[key] - options.escalation for key in first]
    print(f"\nalike, seed {options.seed}\n\n| | |\n|---|---|")
    for name, value in (
        ("hangers that moved alike, kills", f"{len(alerts)}, {options.kills}"),
        ("different messages to the hook", len(keys["ops"])),
        ("tries of them, answers lost", f"{sum(keys['ops'].values())}, "
         f"{sum(lost for hook, *_, lost in pages if hook == 'ops')}"),
        ("alerts that the hook had", len(had["ops"])),
        ("different messages of the escalation", len(keys["chief"])),
        ("alerts that were escalated", len(had["chief"])),
        ("earliest and latest after the time of the escalation",
         f"{min(late, default=-1):.1f} s, {max(late, default=-1):.1f} s"),
        ("until nothing was owed", f"{time.time() - began:.0f} s"),
    ):  # fmt: skip
        print(f"| {name} | {value} |")
    whole = alerts.keys() == had["ops"] == had["chief"] and ended == {"delivered"}
    if not whole or len(keys["ops"]) != 1 or not (0 <= min(late) <= max(late) <= 60):
        raise SystemExit("an alert was lost, told apart, or escalated too early or late")


if __name__ == "__main__":
    main()
