"""Write `config/grafana`: dashboards, data sources and alert rules that Grafana provisions.

    python docs/grafana_files.py

Once for InfluxDB (InfluxQL) and once for Prometheus (PromQL: VictoriaMetrics, or a Prometheus that
scrapes `/metrics`). Both have the same panels; built by grafana-foundation-sdk.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from grafana_foundation_sdk.builders import common, dashboard, stat, timeseries
from grafana_foundation_sdk.cog.encoder import JSONEncoder
from grafana_foundation_sdk.cog.runtime import UnknownDataquery
from grafana_foundation_sdk.models import alerting
from grafana_foundation_sdk.models import common as texts
from grafana_foundation_sdk.models import dashboard as models

FOLDER = Path(__file__).resolve().parents[1] / "config" / "grafana"
STATES = ("Baseline only", "No change", "Cannot judge", "Check", "Watch", "Alert")
URGENCIES = ("none", "next test", "week", "today")
_COLOURS = ("blue", "green", "yellow", "yellow", "orange", "red")
_DAYS = {"shm_hanger": 2}
"""A headline is repeated each day: what is older than two has ended."""


@dataclass(frozen=True)
class Series:
    """What a panel draws: a field of a measurement, for each value of some tags."""

    measurement: str
    field: str
    tags: tuple[str, ...] = ("bridge", "hanger")
    name: str = ""
    of_hanger: bool = False
    counted: bool = False

    @property
    def legend(self) -> str:
        return self.name or " ".join(f"{{{{{tag}}}}}" for tag in self.tags)


@dataclass(frozen=True)
class Source:
    """One kind of database: how a query is written there."""

    kind: str
    uid: str
    latest: Callable[[Series], str]
    history: Callable[[Series], str]
    values: Callable[[str], Any]

    @property
    def reference(self) -> models.DataSourceRef:
        return models.DataSourceRef(self.kind, self.uid)

    def query(self, text: str, letter: str, legend: str, *, instant: bool = False) -> Any:
        shared = {"refId": letter, "datasource": {"type": self.kind, "uid": self.uid}}
        if self.kind == "influxdb":
            alias = legend.replace("{{", "$tag_").replace("}}", "")
            form = "table" if instant else "time_series"
            own: dict[str, Any] = {"query": text, "rawQuery": True, "alias": alias}
            return UnknownDataquery({**shared, **own, "resultFormat": form})
        own = {"expr": text, "legendFormat": legend, "instant": instant, "range": not instant}
        return UnknownDataquery({**shared, **own, "format": "time_series"})


def _influx_where(series: Series) -> str:
    where = ['"bridge" =~ /^${bridge:regex}$/', "$timeFilter"]
    where += ['"hanger" =~ /^${hanger:regex}$/'] if series.of_hanger else []
    return " AND ".join([*where, *(['"counts" = 1'] if series.counted else [])])


def _influx_latest(series: Series) -> str:
    tags = ", ".join(f'"{tag}"' for tag in series.tags)
    return (
        f'SELECT last("{series.field}") FROM "{series.measurement}" '
        f"WHERE {_influx_where(series)} GROUP BY {tags}"
    )


def _influx_history(series: Series) -> str:
    tags = "".join(f', "{tag}"' for tag in series.tags)
    return (
        f'SELECT mean("{series.field}") FROM "{series.measurement}" '
        f"WHERE {_influx_where(series)} GROUP BY time($__interval){tags} fill(none)"
    )


def _prometheus(series: Series, window: str) -> str:
    labels = ['bridge=~"$bridge"'] if series.measurement != "shm_stream" else []
    labels += ['hanger=~"$hanger"'] if series.of_hanger else []
    name = f"{series.measurement}_{series.field}"
    found = f"last_over_time({name}{{{','.join(labels)}}}[{window}])"
    if series.counted:  # of one time VictoriaMetrics keeps both values, 1 and the later 0
        counts = f"min_over_time({series.measurement}_counts[{window}]) == 1"
        found += f" and on (bridge, hanger, test) {counts}"
    return f"max by ({', '.join(series.tags)}) ({found})"


INFLUX = Source(
    "influxdb",
    "shm-influx",
    _influx_latest,
    _influx_history,
    lambda tag: f'SHOW TAG VALUES FROM "shm_hanger" WITH KEY = "{tag}"',
)
PROMETHEUS = Source(
    "prometheus",
    "shm-prometheus",
    lambda series: _prometheus(series, f"{_DAYS.get(series.measurement, 400)}d"),
    lambda series: _prometheus(series, "$__interval"),
    lambda tag: {"query": f"label_values(shm_hanger_state_level, {tag})", "refId": "values"},
)


@dataclass
class Board:
    """A dashboard that grows panel by panel."""

    source: Source
    built: dashboard.Dashboard

    def panel(self, made: Any, title: str, unit: str, series: list[Series], *, latest: bool) -> Any:
        """Add a panel of some series, half as wide as the page; return it for more options."""
        made.title(title).unit(unit).datasource(self.source.reference).span(12).height(8)
        write = self.source.latest if latest else self.source.history
        for letter, each in zip("ABCDEFGH", series, strict=False):
            query = self.source.query(write(each), letter, each.legend, instant=False)
            made.with_target(_Built(query))
        self.built.with_panel(made)
        return made


@dataclass(frozen=True)
class _Built:
    """A finished part where the SDK takes a builder."""

    value: Any

    def build(self) -> Any:
        return self.value


def _stat() -> stat.Panel:
    """Begin a panel of the latest values, each on its colour."""
    last = common.ReduceDataOptions().calcs(["lastNotNull"])
    coloured = stat.Panel().reduce_options(last).text_mode(texts.BigValueTextMode.VALUE_AND_NAME)
    return coloured.color_mode(texts.BigValueColorMode.BACKGROUND)


def _lines() -> timeseries.Panel:
    """Begin a panel over time, with its legend below."""
    legend = common.VizLegendOptions().display_mode(texts.LegendDisplayMode.LIST)
    drawn = timeseries.Panel().draw_style(texts.GraphDrawStyle.LINE).span_nulls(True)
    return drawn.legend(legend.show_legend(True))


def _levels(words: tuple[str, ...], colours: tuple[str, ...]) -> list[models.ValueMapping]:
    """Return the mapping from levels to words and colours."""
    named = {
        str(level): models.ValueMappingResult(text=word, color=colour, index=level)
        for level, (word, colour) in enumerate(zip(words, colours, strict=True))
    }
    return [models.ValueMap(options=named)]


def _begun(source: Source, name: str, title: str) -> Board:
    built = dashboard.Dashboard(f"shm: {title}").uid(f"shm-{name}-{source.kind}").tags(["shm"])
    built.time("now-1y", "now").refresh("5m").timezone("browser").editable()
    link = dashboard.DashboardLink("shm").type(models.DashboardLinkType.DASHBOARDS).tags(["shm"])
    built.link(link.include_vars(True).keep_time(True).as_dropdown(False))
    for tag in ("bridge", "hanger")[: 1 if name == "overview" else 2]:
        variable = dashboard.QueryVariable(tag).label(tag).query(source.values(tag))
        variable.datasource(source.reference).refresh(models.VariableRefresh.ON_TIME_RANGE_CHANGED)
        built.with_variable(variable.multi(True).include_all(True).sort(models.VariableSort(3)))
    if source is INFLUX:
        built.annotation(_Built(_alerts(source)))
    return Board(source, built)


def _alerts(source: Source) -> models.AnnotationQuery:
    """Return the annotations that mark when an alert began and ended."""
    where = '"bridge" =~ /^${bridge:regex}$/ AND $timeFilter'
    query = f'SELECT "title", "text", "event" FROM "shm_alert" WHERE {where}'
    columns = {"textColumn": "text", "titleColumn": "title", "tagsColumn": "event"}

    class Influx(models.AnnotationQuery):
        def to_json(self) -> dict[str, object]:
            return {**super().to_json(), "query": query, "rawQuery": True, **columns}

    return Influx(
        name="alerts", datasource=source.reference, enable=True, icon_color="red", hide=False
    )


def overview(source: Source) -> dashboard.Dashboard:
    """Build the bridge: the state of each hanger, tensions and changes."""
    board = _begun(source, "overview", "bridge")
    state, urgency = Series("shm_hanger", "state_level"), Series("shm_hanger", "urgency_level")
    shown = board.panel(_stat(), "State of each hanger", "none", [state], latest=True)
    shown.mappings(_levels(STATES, _COLOURS)).span(24).height(6)
    shown = board.panel(_stat(), "What to do, how soon", "none", [urgency], latest=True)
    shown.mappings(_levels(URGENCIES, ("green", "blue", "orange", "red")))
    opened = Series("shm_hanger", "open_alerts")
    board.panel(_stat(), "Open alerts", "none", [opened], latest=True)
    tension, change = Series("shm_hanger", "tension_n"), Series("shm_hanger", "change")
    board.panel(_lines(), "Tension", "forcenewton", [tension], latest=False)
    board.panel(_lines(), "Change since baseline", "percentunit", [change], latest=False)
    return board.built


def hanger(source: Source) -> dashboard.Dashboard:
    """Build one hanger: headline with its interval, tests, modes, temperature."""
    board = _begun(source, "hanger", "hanger")

    def of(measurement: str, column: str, *tags: str, **more: Any) -> Series:
        return Series(measurement, column, ("bridge", "hanger", *tags), of_hanger=True, **more)

    state = of("shm_hanger", "state_level")
    shown = board.panel(_stat(), "State", "none", [state], latest=True)
    shown.mappings(_levels(STATES, _COLOURS))
    now = [of("shm_hanger", f"tension{end}_n", name=f"{_HANGER} {word}") for end, word in _ENDS]
    board.panel(_stat(), "Tension, 90 % interval", "forcenewton", now, latest=True)
    title = "Tension: best estimate, 90 % interval"
    board.panel(_lines(), title, "forcenewton", now, latest=False)
    tests = [
        of("shm_test", f"tension{end}_n", name=f"{_HANGER} {word}", counted=True)
        for end, word in _ENDS
    ]
    title = "Tension by each test alone"
    board.panel(_lines(), title, "forcenewton", tests, latest=False).draw_style(
        texts.GraphDrawStyle.POINTS
    )
    modes = [of("shm_mode", "frequency_hz", "plane", "order")]
    board.panel(_lines(), "Frequencies", "hertz", modes, latest=False).draw_style(
        texts.GraphDrawStyle.POINTS
    )
    damping = [of("shm_mode", "damping_ratio", "plane", "order")]
    made = board.panel(_lines(), "Damping", "percentunit", damping, latest=False)
    made.draw_style(_POINTS)
    warmth = [of("shm_test", "temperature_c", counted=True)]
    made = board.panel(_lines(), "Temperature of tests", "celsius", warmth, latest=False)
    made.draw_style(_POINTS)
    return board.built


def sensors(source: Source) -> dashboard.Dashboard:
    """Build the permanent sensors: tension by hour, weather, level; what the stream lacks."""
    board = _begun(source, "sensors", "permanent sensors")

    def of(name: str) -> Series:
        return Series("shm_hour", name, ("bridge", "hanger", "stream"), of_hanger=True)

    for title, unit, name in (
        ("Tension since the beginning", "percentunit", "tension_shift"),
        ("The same at the weather of the beginning", "percentunit", "compensated_shift"),
        ("Temperature", "celsius", "temperature_c"),
        ("Wind", "velocityms", "wind_m_s"),
        ("Level in the band of the modes", "accMS2", "level_m_s2"),
        ("Windows used in the hour", "none", "windows"),
    ):
        board.panel(_lines(), title, unit, [of(name)], latest=False)
    for title, unit, name in _OF_STREAM if source is PROMETHEUS else ():
        series = [Series("shm_stream", name, ("stream",))]
        board.panel(_lines(), title, unit, series, latest=False)
    return board.built


_HANGER = "{{bridge}} {{hanger}}"
_POINTS = texts.GraphDrawStyle.POINTS
_ENDS = (("", "mean"), ("_low", "from"), ("_high", "to"))
_OF_STREAM = (
    ("Since the last sample", "s", "lag_seconds"),
    ("Lost of the last day", "percentunit", "lost_share"),
)


@dataclass(frozen=True)
class Condition:
    """An alert rule: a query, and the value from which on it fires."""

    uid: str
    title: str
    query: str
    above: float
    severity: str
    summary: str
    without_data: str = "OK"


def conditions(source: Source) -> Iterator[Condition]:
    """Yield the alert rules of our states; a page for Prometheus also knows how the daemon is."""
    latest = _influx_rule if source is INFLUX else _prometheus_rule
    # No $ in these words: Grafana takes it for a variable of its environment.
    words = "See the message of the hanger that the label names, in shm."
    urgent = latest("urgency_level")
    yield Condition("shm-today", "A hanger needs action today", urgent, 2.5, "critical", words)
    yield Condition("shm-week", "A hanger needs action this week", urgent, 1.5, "warning", words)
    silent = "shm has published nothing for two days: see that its daemon runs."
    yield Condition(
        "shm-silent", "shm is silent", latest("state_level"), 99.0, "warning", silent, "Alerting"
    )
    if source is PROMETHEUS:
        text = "The daemon's loop has not gone round for five minutes: shm doctor."
        seen = "max(shm_daemon_seen_seconds)"
        yield Condition("shm-daemon", "The daemon of shm is down", seen, 300.0, "critical", text)
        text = "The stream that the label names has sent no sample for an hour."
        lag = "max by (stream) (shm_stream_lag_seconds)"
        yield Condition("shm-stream", "A logger is silent", lag, 3600.0, "warning", text)


def _influx_rule(name: str) -> str:
    where = 'time > now() - 2d GROUP BY "bridge", "hanger"'
    return f'SELECT last("{name}") FROM "shm_hanger" WHERE {where}'


def _prometheus_rule(name: str) -> str:
    return f"max by (bridge, hanger) (last_over_time(shm_hanger_{name}[2d]))"


def rules(source: Source) -> dict[str, Any]:
    """Return the alert rules as Grafana's file for provisioning."""
    made = []
    for each in conditions(source):
        expression = {"refId": "B", "type": "threshold", "expression": "A"}
        expression |= {"conditions": [{"evaluator": {"type": "gt", "params": [each.above]}}]}
        if source is INFLUX:
            expression["expression"] = "C"
        queries = [
            alerting.Query(
                source.uid,
                source.query(each.query, "A", "", instant=source is PROMETHEUS),
                ref_id="A",
                relative_time_range=alerting.RelativeTimeRange(from_val=172800, to=0),
            )
        ]
        if source is INFLUX:  # a threshold takes single numbers
            reduced = {"refId": "C", "type": "reduce", "expression": "A", "reducer": "last"}
            queries.append(alerting.Query("__expr__", UnknownDataquery(reduced), ref_id="C"))
        queries.append(alerting.Query("__expr__", UnknownDataquery(expression), ref_id="B"))
        rule = alerting.Rule(
            annotations={"summary": each.summary},
            condition="B",
            data=queries,
            exec_err_state="Error",
            for_val="5m",
            labels={"severity": each.severity},
            no_data_state=each.without_data,
            org_id=1,
            title=each.title,
            uid=f"{each.uid}-{source.kind}",
        )
        document = _plain(rule)
        made.append(
            {k: v for k, v in document.items() if k not in ("folderUID", "orgID", "ruleGroup")}
        )
    group = {"orgId": 1, "name": "shm", "folder": "shm", "interval": "1m", "rules": made}
    return {"apiVersion": 1, "groups": [group]}


def _plain(value: Any) -> Any:
    return json.loads(json.dumps(value, cls=JSONEncoder))


def files() -> dict[str, str]:
    """Return all files by their paths in `config/grafana`."""
    made = {}
    for name, source in (("influx", INFLUX), ("prometheus", PROMETHEUS)):
        for build in (overview, hanger, sensors):
            text = json.dumps(build(source).build(), cls=JSONEncoder, indent=2, sort_keys=True)
            made[f"{name}/dashboards/{build.__name__}.json"] = f"{text}\n"
        made[f"{name}/alert-rules.yaml"] = yaml.safe_dump(rules(source), sort_keys=False)
        made[f"{name}/data-source.yaml"] = yaml.safe_dump(_data_source(source), sort_keys=False)
        provider = {"name": "shm", "folder": "shm", "type": "file"}
        options = {"options": {"path": "/etc/grafana/shm/dashboards"}}
        made[f"{name}/dashboards.yaml"] = yaml.safe_dump(
            {"apiVersion": 1, "providers": [{**provider, **options}]}, sort_keys=False
        )
    return made


def _data_source(source: Source) -> Mapping[str, Any]:
    found: dict[str, Any] = {"name": "shm", "uid": source.uid, "type": source.kind}
    found |= {"access": "proxy", "url": "$TIMESERIES_URL"}
    if source is INFLUX:
        found |= {
            "user": "$TIMESERIES_USER",
            "jsonData": {"dbName": "shm", "version": "InfluxQL"},
        }
        found |= {"secureJsonData": {"password": "$TIMESERIES_PASSWORD"}}
    return {"apiVersion": 1, "datasources": [found]}


if __name__ == "__main__":
    for path, text in files().items():
        target = FOLDER / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
