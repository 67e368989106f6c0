"""The open warnings of the hangers of a workspace, from what its store says.

Nothing here imports what computes: `shm status` asks it, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from shm.report.open_warnings import nearly_slack, open_warnings, passed_over, standing_out
from shm.store import BaselineGlance, Silence, Store, StoredWatch, TrendPoint, Workspace
from shm.store.checksums import of_readable
from shm.store.stored_alerts import said_of
from shm.values import TENSION, Hanger


def warnings_of(
    workspace: Workspace, store: Store, hangers: Sequence[Hanger]
) -> dict[int, tuple[str, ...]]:
    """The open warnings of each of `hangers` that has a baseline, by hanger."""
    every = workspace.bridge.hangers
    latest = of_readable(partial(store.watch.latest, hangers=hangers), {})
    now, baselines = store.posteriors.latest_trends(hangers), store.watch.baselines_in_force(every)
    works = [each for each in store.silences.list_all() if each.is_maintenance]
    return warnings_from(every, hangers, baselines, latest, now, works)


def warnings_from(
    every: Sequence[Hanger],
    hangers: Sequence[Hanger],
    baselines: Mapping[int, BaselineGlance],
    latest: Mapping[int, StoredWatch],
    now: Mapping[int, TrendPoint],
    works: Sequence[Silence],
) -> dict[int, tuple[str, ...]]:
    """The same of what was asked already: the `baselines` of `every` hanger of the bridge.

    `works` are maintenance windows.
    """
    tensions = {id_: each.averaged.tension_n for id_, each in baselines.items()}

    def slack(hanger: Hanger) -> str:
        watched = latest[hanger.id].watched if hanger.id in latest else None
        if hanger.id not in now or watched is None:
            return ""
        level = hanger.thresholds.alert_probability
        is_told = any(d.quantity == TENSION and d.probability >= level for d in watched.drifts)
        of_test = now[hanger.id].averaged.tension_n
        return nearly_slack(hanger, tensions[hanger.id], of_test, is_told=is_told)

    def of_works(hanger: Hanger) -> str:
        point, watched = now.get(hanger.id), latest.get(hanger.id)
        if point is None or point.test in baselines[hanger.id].tests:
            return ""
        if watched is not None and watched.watched.time >= point.time:
            return ""
        windows = [each for each in works if each.covers(hanger.id, point.time)]
        return passed_over(hanger, said_of(windows[-1])) if windows else ""

    return {
        hanger.id: open_warnings(
            hanger,
            baselines[hanger.id].check,
            standing_out(hanger, every, tensions),
            latest[hanger.id].watched if hanger.id in latest else None,
            (slack(hanger), of_works(hanger)),
        )
        for hanger in hangers
        if hanger.id in baselines
    }
