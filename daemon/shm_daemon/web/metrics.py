"""Metrics for Prometheus, computed at each scrape, so that no process needs to store counts.

It is made in parts. A part that fails is left out, counted in `shm_scrape_errors_total` and logged;
the others answer, so that one odd row or folder never blinds those who watch.

For those who watch over the daemon: health, and metrics for Prometheus.
"""

from __future__ import annotations

import logging
import math
import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from datetime import timedelta
from functools import partial
from typing import Any

import numpy as np
from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4 as CONTENT_TYPE
from prometheus_client.registry import Collector

from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import hanger_summaries
from shm.pipeline.publishing import HANGER, summary_fields
from shm.pipeline.stream_state import StreamCondition, stream_states
from shm.store import Workspace
from shm.store.alerts import count_alerts, count_deliveries
from shm.store.recordings import count_stages, find_oldest_waiting, list_stage_seconds
from shm.store.ring import ring_of
from shm.store.rows import ON_THE_WAY
from shm_daemon.heartbeat import seconds_since_beat
from shm_daemon.spool import scan
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.faults import answers
from shm_daemon.web.health import health_document
from shm_daemon.web.middleware import HEALTH, METRICS
from shm_daemon.web.models import Health
from shm_daemon.web.site import Site, quarantined

_LATELY = timedelta(hours=1)
_QUANTILES = (0.5, 0.95, 1.0)  # the usual, the slow and the slowest

log = logging.getLogger(__name__)


class Exposition(Collector):
    """The page for Prometheus, and how often each part of it has failed since the beginning."""

    def __init__(self, site: Site):
        self._site = site
        self._errors: Counter[str] = Counter(dict.fromkeys(["store", *_PARTS, *_OF_STORE], 0))
        self._said: dict[str, str] = {}

    def page(self) -> bytes:
        """Return the metrics of a separate registry as text of Prometheus."""
        registry = CollectorRegistry(auto_describe=False)
        registry.register(self)
        return generate_latest(registry)

    def describe(self) -> list[Metric]:
        return []  # or registering would measure once more

    def collect(self) -> Iterator[Metric]:
        for name, gauge in _PARTS.items():
            yield from self._made(name, partial(_of_workspace, *gauge))
        up = self._made("store", _usable)
        yield from up or [_store_up(is_up=False)]
        if up:  # else each part would wait in vain for a server that is away
            for name, part in _OF_STORE.items():
                yield from self._made(name, part)
        text = "How often a part of this page could not be made, since the interface began."
        errors = CounterMetricFamily("shm_scrape_errors", text, labels=["part"])
        for name, times in self._errors.items():
            errors.add_metric([name], times)
        yield errors

    def _made(self, name: str, part: _Part) -> list[Metric]:
        """Return a part as a whole; nothing where it fails, for whatever reason."""
        try:
            made = list(part(self._site))
        except Exception as error:
            self._errors[name] += 1
            if self._said.get(name) != str(error):  # else a line at each scrape
                self._said[name] = str(error)
                log.exception("the part %s of /metrics cannot be made", name)
            return []
        self._said.pop(name, None)
        return made


def _of_workspace(
    name: str, text: str, value: Callable[[Workspace], float | None], site: Site
) -> Iterator[Metric]:
    found = value(site.workspace)
    if found is not None:
        yield GaugeMetricFamily(name, text, found)


def _usable(site: Site) -> Iterator[Metric]:
    count_alerts(site.store)
    yield _store_up(is_up=True)


def _queue(site: Site) -> Iterator[Metric]:
    looks, counts = scan(site.workspace.spool), count_stages(site.store)
    waiting = len(looks) + sum(counts[stage] for stage in ON_THE_WAY)
    text = "Files in the spool and recordings that are not through."
    yield GaugeMetricFamily("shm_queue_length", text, waiting)
    changed_s = [time.time() - look.modified_ns / 1e9 for look in looks.values()]
    oldest = find_oldest_waiting(site.store)
    stored_s = [(utc_now() - oldest).total_seconds()] if oldest else []
    text = "How long the oldest of the queue has waited; 0 where it is empty."
    yield GaugeMetricFamily("shm_queue_oldest_seconds", text, max([0.0, *changed_s, *stored_s]))


def _recordings(site: Site) -> Iterator[Metric]:
    counts = count_stages(site.store)
    yield _labelled("shm_recordings", "Recordings at a stage.", "stage", counts)


def _alerts(site: Site) -> Iterator[Metric]:
    counts = dict(zip(("open", "acknowledged"), count_alerts(site.store), strict=True))
    yield _labelled("shm_alerts", "Alerts raised.", "state", counts)


def _deliveries(site: Site) -> Iterator[Metric]:
    counts = count_deliveries(site.store)
    yield _labelled("shm_deliveries", "Alerts to hooks.", "state", counts)


def _hangers(site: Site) -> Iterator[Metric]:
    """Yield the headline of each hanger under the names that published points have."""
    families: dict[str, GaugeMetricFamily] = {}
    labels = ["bridge", "hanger"]
    for summary in hanger_summaries(site.workspace, site.store, utc_now()):
        for name, value in summary_fields(summary).items():
            if not isinstance(value, str):
                named, text = f"{HANGER}_{name}", "See docs/publishing.md."
                family = families.setdefault(name, GaugeMetricFamily(named, text, labels=labels))
                family.add_metric([site.workspace.bridge.name, str(summary.hanger.id)], value)
    yield from families.values()


def _stages(site: Site) -> Iterator[Metric]:
    lately = list_stage_seconds(site.store, utc_now() - _LATELY)
    text = "From the stage before to this one, over the last hour: quantiles."
    seconds = GaugeMetricFamily("shm_stage_seconds", text, labels=["stage", "quantile"])
    for stage, values in lately.items():
        for quantile, value in zip(_QUANTILES, np.quantile(values, _QUANTILES), strict=True):
            seconds.add_metric([stage, str(quantile)], float(value))
    yield seconds
    reached = {stage: len(values) for stage, values in lately.items()}
    yield _labelled("shm_stage_reached", "How often a stage was reached, over the last hour.",
                    "stage", reached)  # fmt: skip


def _streams(site: Site) -> Iterator[Metric]:
    ring, now = ring_of(site.workspace), utc_now()
    states = stream_states(site.workspace, ring, site.store, now)
    columns: tuple[tuple[str, str, Callable[[StreamCondition], float | timedelta | None]], ...] = (
        ("lag_seconds", "How long ago the last sample of a stream was measured.",
         lambda state: state.lag),
        ("behind_seconds", "How much of a stream has come and is not read yet.",
         lambda state: state.behind),
        ("lost_share", "What did not come of the samples of the last day.",
         lambda state: state.lost_share),
        ("apart_seconds", "Samples of the last day for a time that was there: kept apart.",
         lambda state: state.apart_s),
        ("ring_bytes", "Room that the raw samples of a stream take.",
         lambda state: state.ring_bytes),
    )  # fmt: skip
    for name, text, value in columns:
        family = GaugeMetricFamily(f"shm_stream_{name}", text, labels=["stream"])
        for state in states:
            found = value(state)
            found = found.total_seconds() if isinstance(found, timedelta) else found
            family.add_metric([state.stream.name], math.nan if found is None else found)
        yield family


_Part = Callable[[Site], Iterator[Metric]]
_PARTS: Mapping[str, tuple[str, str, Callable[[Workspace], float | None]]] = {
    "spool": ("shm_spool_files", "Files in the spool.", lambda of: len(scan(of.spool))),
    "quarantine": (
        "shm_quarantined_files", "Refused files in the quarantine.", lambda of: quarantined(of)
    ),
    "disk": (
        "shm_disk_free_bytes", "Room on the disk of the workspace.",
        lambda of: shutil.disk_usage(of.folder).free,
    ),
    "daemon": (
        "shm_daemon_seen_seconds", "How long ago the daemon's loop last went round.",
        seconds_since_beat,
    ),
}  # fmt: skip
_OF_STORE: Mapping[str, _Part] = {
    "queue": _queue,
    "recordings": _recordings,
    "alerts": _alerts,
    "deliveries": _deliveries,
    "hangers": _hangers,
    "stages": _stages,
    "streams": _streams,
}


def _store_up(*, is_up: bool) -> Metric:
    return GaugeMetricFamily("shm_store_up", "Whether the store can be used.", float(is_up))


def _labelled(name: str, text: str, label: str, values: Mapping[str, int]) -> GaugeMetricFamily:
    family = GaugeMetricFamily(name, text, labels=[label])
    for key, value in values.items():
        family.add_metric([key], value)
    return family


router = APIRouter(tags=["watching"])


@router.get(
    HEALTH,
    response_model=Health,
    responses={
        **answers(400),
        503: {"model": Health, "description": "Store, spool or daemon fail."},
    },
    summary="Whether all is well",
)
def health(site: AtSite) -> Any:
    """Needs no token and tells no secrets: for load balancers and service managers.

    What works, though not as it is described now, is `degraded` and answers 200.
    """
    status, document = health_document(site)
    return JSONResponse(document, status)


@router.get(
    METRICS,
    response_class=Response,
    responses={
        200: {"content": {CONTENT_TYPE: {"schema": {"type": "string"}}}},
        **answers(400, 401, 403),
    },
    summary="Metrics for Prometheus",
    description=(
        "Computed from store and spool at each scrape; `shm_store_up` is 0 where the store is out, "
        "and\n`shm_scrape_errors_total` counts what could not be told."
    ),
)
def metrics(request: Request, _: Reader) -> Response:
    """Return the metrics, computed from store and spool at each scrape."""
    exposition: Exposition = request.app.state.exposition
    return Response(exposition.page(), headers={"Content-Type": CONTENT_TYPE})
