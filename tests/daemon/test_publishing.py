"""Results to time-series databases: each once, whatever the server does meanwhile."""

from __future__ import annotations

import json
import logging
import re
import shutil
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import httpx
import pytest
import yaml
from click.testing import CliRunner

import shm_daemon
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import hanger_summaries
from shm.store import Workspace
from shm.store.point_outbox import PointOutbox
from shm_cli.main import cli
from shm_daemon.doctor import examine
from shm_daemon.publishing import Publisher
from tests.helpers.flows import ingest, threads
from tests.helpers.listeners import Answer, Told, a_listener
from tests.helpers.pages import ROOT
from tests.helpers.quick_update import stand_in
from tests.helpers.streams import a_reading, with_stream
from tests.helpers.time_series import a_victoria_metrics, an_influxdb
from tests.helpers.waiting import until
from tests.helpers.workspaces import SLOW_LOSS, make_workspace, write_test

SERIES = re.compile(r"(?:\\.|[^ \\])+")
"""Measurement and tags: up to the first blank that is not escaped."""
GRAFANA = ROOT / "config" / "grafana"
NAME = 'Bridge "A", north = old'


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 lost tension, of which there is an alert; hanger 4 has one test, 5 none."""
    folder = tmp_path_factory.mktemp("publish") / "bridge"
    workspace = make_workspace(folder, hangers=(3, 4, 5))
    for place, tension in enumerate(SLOW_LOSS):
        path = workspace.spool / f"t{place}.modes.json"
        write_test(path, workspace, day=30 * (place - 4), tension=tension)
    write_test(workspace.spool / "four.modes.json", workspace, hanger=4)
    with pytest.MonkeyPatch.context() as patch:
        stand_in(patch.setattr)
        ingest(workspace)
    return workspace


@pytest.fixture
def bridge(measured: Workspace, tmp_path: Path) -> Workspace:
    """Copy it with a stream of hanger 3 and an hour of it, under a name that has to be escaped."""
    folder = tmp_path / "bridge"
    shutil.copytree(measured.folder, folder)
    text = (folder / "bridge.toml").read_text()
    (folder / "bridge.toml").write_text(text.replace('"Test bridge"', f"'{NAME}'"))
    workspace = with_stream(Workspace.open(folder))
    with workspace.store() as store:
        store.streams.save_pooled(a_reading(), b"state")
    return workspace


def publishing(workspace: Workspace, url: str, more: str = 'database = "shm"') -> Workspace:
    path = workspace.folder / "bridge.toml"
    path.write_text(f'{path.read_text()}\n[[publish]]\nkind = "influx"\nurl = "{url}"\n{more}\n')
    return workspace.reopened()


def publish(workspace: Workspace) -> None:
    """Publish once, as the daemon does with --once."""
    with closing(Publisher(workspace, utc_now)) as publisher:
        publisher.turn()


def status(workspace: Workspace) -> str:
    answer = CliRunner().invoke(cli, ["--workspace", str(workspace.folder), "status"])
    assert answer.exit_code == 0
    return " ".join(answer.output.split())


def doctor(workspace: Workspace) -> tuple[str, str]:
    found = examine(workspace.folder, utc_now())
    (finding,) = (each for each in found if each.check == "publish influx")
    return finding.level, finding.found


def waiting(workspace: Workspace) -> int:
    return PointOutbox(workspace.folder).state("influx").waiting


def counts(database: object) -> dict[str, int]:
    """Return how many points each measurement of an InfluxDB has."""
    found = {}
    for name in ("shm_hanger", "shm_test", "shm_mode", "shm_hour", "shm_alert"):
        rows = database.influxql(f"SELECT * FROM {name}")  # type: ignore[attr-defined]
        found[name] = len(rows)
    return found


# ---------------------------------------------------------------- real servers


def test_daemon_publishes_to_influxdb(bridge: Workspace, tmp_path: Path) -> None:
    with an_influxdb(tmp_path) as database:
        database.influxql("CREATE DATABASE shm")
        workspace = publishing(bridge, database.url)
        shm_daemon.run(workspace, once=True, make_executor=threads)

        (row, *others) = database.influxql("SELECT * FROM shm_hanger WHERE hanger = '3'")
        with workspace.store() as store:
            summary, _, _ = hanger_summaries(workspace, store, utc_now())
            alerts = len(store.alerts.list_all())
        tension = summary.tension_n
        assert not others
        assert tension is not None
        assert row["bridge"] == NAME
        assert (row["tension_n"], row["tension_low_n"]) == (tension.mean, tension.low)
        assert row["state"] == "Alert"
        assert row["message"] == summary.message.lead.words
        found = counts(database)
        # Twelve modes of each of eight tests, and the two of the hour; hanger 5 has no state.
        assert found == {
            "shm_hanger": 2,
            "shm_test": 8,
            "shm_mode": 98,
            "shm_hour": 1,
            "shm_alert": alerts,
        }
        (text,) = database.influxql("SELECT title, text FROM shm_alert WHERE hanger = '3'")
        assert str(text["text"]).startswith("Hanger 3")

        publish(workspace)
        assert counts(database) == found
        assert waiting(workspace) == 0
        assert doctor(workspace)[0] == "ok"
        assert "publish" not in status(workspace)


def test_influxdb_down_gets_everything_once(bridge: Workspace, tmp_path: Path) -> None:
    with an_influxdb(tmp_path) as database:
        database.influxql("CREATE DATABASE shm")
        workspace = publishing(bridge, database.url)
        publish(workspace)
        before = counts(database)
        database.stop()

        write_test(workspace.spool / "t8.modes.json", workspace, day=90, tension=0.92)
        shm_daemon.run(workspace, once=True, make_executor=threads)
        assert "points wait since" in status(workspace)
        assert doctor(workspace) == ("warning", doctor(workspace)[1])
        assert "Connection refused" in doctor(workspace)[1]

        database.begin()
        publish(workspace)
        after = counts(database)
        assert after["shm_test"] == before["shm_test"] + 1
        assert after["shm_mode"] == before["shm_mode"] + 12
        assert waiting(workspace) == 0


def test_influxdb_wrong_database_and_token(bridge: Workspace, tmp_path: Path) -> None:
    with an_influxdb(tmp_path, auth=True) as database:
        admin = "CREATE USER ann WITH PASSWORD 'secret' WITH ALL PRIVILEGES"
        database.influxql(admin)
        login = {"u": "ann", "p": "secret"}
        token = bridge.folder / "influx.token"
        token.write_text("ann:wrong\n")
        workspace = publishing(
            bridge, database.url, 'database = "shm"\ntoken_file = "influx.token"'
        )
        publish(workspace)
        assert "answered 401: authorization failed" in status(workspace)
        assert "Correct the token" in status(workspace)
        assert "wrong" not in status(workspace)

        token.write_text("ann:secret\n")
        publish(workspace)
        assert 'answered 404: database not found: "shm"' in status(workspace)
        assert "Create shm there" in status(workspace)

        database.influxql("CREATE DATABASE shm", **login)
        publish(workspace)
        assert waiting(workspace) == 0
        assert len(database.influxql("SELECT * FROM shm_test", **login)) == 8
        token.unlink()
        publish(workspace)
        assert "influx.token cannot be read" in doctor(workspace)[1]


@pytest.mark.parametrize("kind", ['database = "shm"', 'organisation = "city"\nbucket = "shm"'])
def test_publish_to_victoria_metrics(bridge: Workspace, tmp_path: Path, kind: str) -> None:
    """It takes both versions of the protocol over HTTP."""
    with a_victoria_metrics(tmp_path) as database:
        workspace = publishing(bridge, database.url, kind)
        publish(workspace)
        publish(workspace)

        with workspace.store() as store:
            summary, _, _ = hanger_summaries(workspace, store, utc_now())
        series = database.export("shm_")
        of = {
            (each["metric"]["__name__"], each["metric"].get("hanger")): each  # type: ignore[index, attr-defined]
            for each in series
        }
        assert summary.tension_n is not None
        assert of["shm_hanger_tension_n", "3"]["values"] == [pytest.approx(summary.tension_n.mean)]
        assert of["shm_hanger_state_level", "3"]["values"] == [5]
        tests = [each for each in series if each["metric"]["__name__"] == "shm_test_tension_n"]  # type: ignore[index]
        assert sum(len(each["values"]) for each in tests) == 8  # type: ignore[arg-type]


# ---------------------------------------------------------------- Grafana's files


def queries(kind: str, name: str) -> dict[str, str]:
    """Return the queries of a dashboard, by panel and letter, with its variables filled in."""
    board = json.loads((GRAFANA / kind / "dashboards" / f"{name}.json").read_text())
    filled = {"${bridge:regex}": ".*", "${hanger:regex}": ".*", "$timeFilter": "time > 0"}
    filled |= {"$__interval": "30d", "$bridge": ".*", "$hanger": ".*"}
    found = {}
    for panel in board["panels"]:
        for target in panel["targets"]:
            text = target.get("query") or target["expr"]
            for variable, value in filled.items():
                text = text.replace(variable, value)
            found[f"{panel['title']} {target['refId']}"] = text
    return found


EMPTY = {"Tension since the beginning A", "The same at the weather of the beginning A", "Wind A"}
"""Panels of the sensors whose fields the one hour of the tests does not have."""


def test_dashboards_query_influxdb(bridge: Workspace, tmp_path: Path) -> None:
    with an_influxdb(tmp_path) as database:
        database.influxql("CREATE DATABASE shm")
        publish(publishing(bridge, database.url))

        boards = {name: queries("influx", name) for name in ("overview", "hanger", "sensors")}
        empty = {
            panel
            for board in boards.values()
            for panel, query in board.items()
            if not database.influxql(query)
        }
        rules = yaml.safe_load((GRAFANA / "influx" / "alert-rules.yaml").read_text())
        for rule in rules["groups"][0]["rules"]:
            assert database.influxql(rule["data"][0]["model"]["query"])
    assert empty == EMPTY


# ---------------------------------------------------------------- a server of our own


class Server:
    """Takes lines, or not, as it is told; notes those that it took.

    It refuses, with `refusal`, requests of more than `max_lines` or with a line of `bad`; of the
    latter it takes the other lines if it is `partial`, as InfluxDB does.
    """

    def __init__(self) -> None:
        self.taken: Counter[str] = Counter()
        self.answer, self.takes = Answer(204), True
        self.bad, self.refusal, self.partial, self.max_lines = "?", Answer(400), False, 10**6

    def __call__(self, told: Told) -> Answer:
        lines = told.body.decode().splitlines()
        good = [line for line in lines if not line.startswith(self.bad)]
        if len(lines) > self.max_lines or len(good) < len(lines):
            self.taken.update(good if self.partial else ())
            return self.refusal
        if self.takes:
            self.taken.update(lines)
        return self.answer


@pytest.fixture
def server() -> Server:
    return Server()


@pytest.fixture
def workspace(bridge: Workspace, server: Server) -> Iterator[Workspace]:
    with a_listener(server) as listener:
        yield publishing(bridge, listener.url.removesuffix("/alerts"))


def test_publish_again_same_lines(workspace: Workspace, server: Server) -> None:
    server.answer = Answer(cut=True)  # it has taken them, and says so to nobody
    publish(workspace)
    server.answer = Answer(204)
    publish(workspace)

    assert max(server.taken.values()) == 2
    keys = [(SERIES.match(line), line.rpartition(" ")[2]) for line in server.taken]
    found = {(series[0], at) for series, at in keys if series}
    assert len(found) == len(server.taken)  # a point comes as the same line, which replaces itself


def test_publish_excluded_test(workspace: Workspace, server: Server) -> None:
    publish(workspace)
    command = ["--workspace", str(workspace.folder), "ingest", "--discard", "t2", "--why", "car"]
    answer = CliRunner().invoke(cli, command)
    assert answer.exit_code == 0, answer.output
    publish(workspace)

    lines = [line for line in server.taken if line.startswith("shm_test") and "test=t2 " in line]
    assert [" counts=0i " in line for line in lines] == [False, True]


def test_publish_state_when_it_changes(workspace: Workspace, server: Server) -> None:
    def states() -> list[str]:
        return [
            line for line in server.taken if line.startswith("shm_hanger") and "hanger=3" in line
        ]

    publish(workspace)
    publish(workspace)
    assert len(states()) == 1
    with workspace.store() as store:
        alert = next(each for each in store.alerts.list_all() if each.alert.hanger == 3)
        store.alerts.acknowledge(alert.id, "ann", "seen", utc_now())
    publish(workspace)
    assert len(states()) == 2


def test_influxdb_refuses_some_points(bridge: Workspace, tmp_path: Path, caplog) -> None:
    with an_influxdb(tmp_path) as database:
        database.influxql("CREATE DATABASE shm")
        # In the shard of t4 the field is a text, as somebody else wrote it.
        somebodys = 'shm_test,hanger=9 counts="yes" 1777636800000000000'
        httpx.post(f"{database.url}/write?db=shm", content=somebodys).raise_for_status()
        workspace = publishing(bridge, database.url)
        with caplog.at_level(logging.WARNING):
            publish(workspace)

        refused = re.search(r"(\d+) of \d+ points were refused.*field type conflict", caplog.text)
        assert refused
        assert f"{refused[1]} points were refused: the log says why" in status(workspace)
        stored = len(database.influxql("SELECT * FROM shm_test WHERE hanger != '9'"))
        assert stored + int(refused[1]) == 8
        found = counts(database)
        assert (found["shm_mode"], found["shm_hour"]) == (98, 1)
        assert waiting(workspace) == 0

        database.influxql("DROP MEASUREMENT shm_test")
        publish(workspace)
        assert "refused" not in status(workspace)
        assert counts(database)["shm_test"] == int(refused[1])  # those alone are sent again


def test_dashboards_query_victoria_metrics(bridge: Workspace, tmp_path: Path) -> None:
    with a_victoria_metrics(tmp_path) as database:
        publish(publishing(bridge, database.url))

        boards = {name: queries("prometheus", name) for name in ("overview", "hanger", "sensors")}
        empty = {
            panel
            for board in boards.values()
            for panel, query in board.items()
            if not database.promql(query)
        }
        # The page for Prometheus alone knows the streams.
        assert empty == {*EMPTY, "Since the last sample A", "Lost of the last day A"}

        only_test = ["--workspace", str(bridge.folder), "ingest", "--discard", "four", "--why", "x"]
        assert CliRunner().invoke(cli, only_test).exit_code == 0
        by_test = boards["hanger"]["Tension by each test alone A"]
        before = {str(each["metric"]) for each in database.promql(by_test)}
        publish(bridge.reopened())
        after = {str(each["metric"]) for each in database.promql(by_test)}
    assert before - after == {str({"bridge": 'Bridge "A", north = old', "hanger": "4"})}


@pytest.mark.parametrize(
    "answer",
    [Answer(503, b"<html>"), Answer(200, b"<html>login"), Answer(302), Answer(cut=True)],
)
def test_publish_after_failure(workspace: Workspace, server: Server, answer: Answer) -> None:
    server.answer, server.takes = answer, False
    publish(workspace)
    n_points = waiting(workspace)
    assert n_points > 100
    assert f"{n_points} points wait" in status(workspace)

    server.answer, server.takes = Answer(204), True
    publish(workspace)
    assert waiting(workspace) == 0
    assert len(server.taken) >= n_points
    assert set(server.taken.values()) == {1}


@pytest.mark.parametrize("partial", [False, True])
def test_publish_refuses_only_bad_lines(
    workspace: Workspace, server: Server, caplog: pytest.LogCaptureFixture, partial: bool
) -> None:
    server.bad, server.partial = "shm_hour", partial
    server.refusal = Answer(400, b'{"error": "partial write: dropped=1"}')
    with caplog.at_level(logging.WARNING):
        publish(workspace)

    assert re.search(r"publish influx: 1 of \d\d\d points were refused.*dropped=1", caplog.text)
    assert "1 points were refused" in status(workspace)
    assert "sent again when the daemon begins" in status(workspace)
    assert waiting(workspace) == 0
    assert Counter(line.split(",")[0] for line in server.taken)["shm_mode"] == 98

    server.bad = "?"
    publish(workspace)
    assert "refused" not in status(workspace)
    assert any(line.startswith("shm_hour") for line in server.taken)


def test_publish_in_smaller_parts(workspace: Workspace, server: Server) -> None:
    server.max_lines, server.refusal = 10, Answer(413)
    publish(workspace)

    assert waiting(workspace) == 0
    assert "refused" not in status(workspace)
    assert len(server.taken) > 100
    assert set(server.taken.values()) == {1}


@pytest.mark.parametrize(
    ("kind", "header"),
    [
        ('database = "shm"', "Basic YW5uOnNlY3JldA=="),
        ('organisation = "city"\nbucket = "shm"', "Token ann:secret"),
    ],
)
def test_publish_sends_token(
    bridge: Workspace, monkeypatch: pytest.MonkeyPatch, kind: str, header: str
) -> None:
    monkeypatch.setenv("INFLUX_TOKEN", "ann:secret")
    with a_listener(lambda _: Answer(204)) as listener:
        url = listener.url.removesuffix("/alerts")
        publish(publishing(bridge, url, f'{kind}\ntoken_env = "INFLUX_TOKEN"'))
    assert {told.headers["Authorization"] for told in listener.told} == {header}


def test_running_daemon_goes_on(workspace: Workspace, server: Server) -> None:
    server.answer, server.takes = Answer(500), False
    publisher = Publisher(workspace, utc_now, pause_s=0.05, retry_s=0.05)
    with closing(publisher), publisher.running():
        until(lambda: waiting(workspace) > 100)
        server.answer, server.takes = Answer(204), True
        until(lambda: waiting(workspace) == 0)
    assert set(server.taken.values()) == {1}
