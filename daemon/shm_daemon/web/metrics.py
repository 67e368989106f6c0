"""What Prometheus scrapes: made anew at each scrape, so that no process needs to keep counts."""

from __future__ import annotations

import logging
import shutil
import time
from collections.abc import Iterator
from datetime import timedelta

import numpy as np
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4 as CONTENT_TYPE
from prometheus_client.registry import Collector

from shm.errors import ShmError
from shm.pipeline import utc_now
from shm.store import Stage, Store
from shm_daemon.heartbeat import seconds_since_beat
from shm_daemon.spool import scan
from shm_daemon.web.hangers import quarantined
from shm_daemon.web.site import Site

__all__ = ["CONTENT_TYPE", "exposition"]

_LATELY = timedelta(hours=1)
_QUANTILES = (0.5, 0.95, 1.0)
_ENDED = (Stage.DONE, Stage.REFUSED)

log = logging.getLogger(__name__)


def exposition(site: Site) -> bytes:
    """The page for Prometheus, in a registry of its own."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Measured(site))
    return generate_latest(registry)


class _Measured(Collector):
    def __init__(self, site: Site):
        self._site = site

    def describe(self) -> list[Metric]:
        return []  # or registering would measure once more

    def collect(self) -> Iterator[Metric]:
        looks = scan(self._site.workspace.spool)
        changed_s = [look.modified_ns / 1e9 for look in looks.values()]
        spooled_s = max(0.0, time.time() - min(changed_s)) if changed_s else 0.0
        yield _gauge("shm_spool_files", "Files in the spool.", len(looks))
        yield from self._folders()
        try:
            measured = list(_of_store(self._site.store, len(looks), spooled_s))
        except ShmError as error:
            log.error("%s", error)
            measured = []
        yield _gauge("shm_store_up", "Whether the store can be used.", float(bool(measured)))
        yield from measured

    def _folders(self) -> Iterator[Metric]:
        workspace = self._site.workspace
        text = "Refused files in the quarantine."
        yield _gauge("shm_quarantined_files", text, quarantined(workspace))
        free = shutil.disk_usage(workspace.folder).free
        yield _gauge("shm_disk_free_bytes", "Room on the disk of the workspace.", free)
        ago = seconds_since_beat(workspace)
        if ago is not None:
            text = "How long ago the daemon's loop last went round."
            yield _gauge("shm_daemon_seen_seconds", text, ago)


def _of_store(store: Store, spooled: int, spooled_s: float) -> Iterator[Metric]:
    counts = store.stage_counts()
    waiting = sum(n for stage, n in counts.items() if stage not in _ENDED)
    text = "Files in the spool and recordings that are not through."
    yield _gauge("shm_queue_length", text, spooled + waiting)
    oldest, now = store.oldest_waiting(), utc_now()
    waited_s = (now - oldest).total_seconds() if oldest else 0.0
    text = "How long the oldest of the queue has waited; 0 where it is empty."
    yield _gauge("shm_queue_oldest_seconds", text, max(spooled_s, waited_s))
    yield _labelled("shm_recordings", "Recordings at a stage.", "stage", counts)
    alerts = dict(zip(("open", "acknowledged"), store.alert_counts(), strict=True))
    yield _labelled("shm_alerts", "Alerts raised.", "state", alerts)
    yield _labelled("shm_deliveries", "Alerts to hooks.", "state", store.delivery_counts())
    lately = store.stage_seconds(now - _LATELY)
    text = "From the stage before to this one, over the last hour: quantiles."
    seconds = GaugeMetricFamily("shm_stage_seconds", text, labels=["stage", "quantile"])
    for stage, values in lately.items():
        for quantile, value in zip(_QUANTILES, np.quantile(values, _QUANTILES), strict=True):
            seconds.add_metric([stage, str(quantile)], float(value))
    yield seconds
    reached = {stage: len(values) for stage, values in lately.items()}
    yield _labelled("shm_stage_reached", "How often a stage was reached, over the last hour.",
                    "stage", reached)  # fmt: skip


def _gauge(name: str, text: str, value: float) -> GaugeMetricFamily:
    return GaugeMetricFamily(name, text, value)


def _labelled(name: str, text: str, label: str, values: object) -> GaugeMetricFamily:
    family = GaugeMetricFamily(name, text, labels=[label])
    assert isinstance(values, dict)
    for key, value in values.items():
        family.add_metric([str(key)], value)
    return family
