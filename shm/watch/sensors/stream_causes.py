"""Name the cause of a change that permanent sensors show: the hypotheses of hammer tests.

The hours before a change and those since are two tests, read against the baseline as any other. A
change of one plane alone is of its ends; what is the measurement's is no change of the hanger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from shm.values import PLANES, FloatArray, Hanger, ModalTest, Mode, Moved, Plane, Posterior
from shm.watch.engine.causes import SENSOR_MASS, TIMEBASE, UNEXPLAINED, structure_of
from shm.watch.engine.change_point import evidence_of, sums_of
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.options import WatchOptions
from shm.watch.engine.posterior_summary import SummaryContext, rank_causes
from shm.watch.engine.readings import Reader
from shm.watch.sensors.stream_reading import ModeTable, baseline_of
from shm.watch.state_sums import effects_of

EXCHANGED = "exchanged planes"
"""A cause that no hammer test has: the cables of the sensors are exchanged. Record 0002."""
_NEVER = datetime(2000, 1, 1, tzinfo=UTC)  # technical: these readings need no time


@dataclass(frozen=True, eq=False)
class StreamCause:
    """All that may have `moved`, the most probable first, and by how much each mode did (n,).

    `plane` is the only one of which anything moved, None where it is both.
    """

    moved: tuple[Moved, ...]
    by_mode: FloatArray
    plane: Plane | None

    @property
    def name(self) -> str:
        return self.moved[0].quantity

    @property
    def is_measurement(self) -> bool:
        """Return True if it is none of the hanger, so that nobody need go there today."""
        return self.name in (TIMEBASE, SENSOR_MASS)

    @property
    def takes_hours(self) -> bool:
        """Return True if two mistaken modes in a few hours look like it."""
        return self.name in (SENSOR_MASS, UNEXPLAINED)


def find_cause(
    moved: FloatArray,
    table: ModeTable,
    baseline: Posterior | None,
    hanger: Hanger,
    wander_sd: float = 0.0,
) -> StreamCause:
    """Find the cause of mean log frequencies that `moved` (n,), NaN where that is not known.

    Whatever the cause, ln T has wandered by `wander_sd` from the hours before to those since.
    """
    known = np.isfinite(moved)
    nothing = StreamCause((Moved(UNEXPLAINED, 1.0, np.nan, np.nan),), moved, None)
    if not known.any():
        return nothing
    keys = [key for key, its in zip(table.modes, known, strict=True) if its]
    level, sd = table.level[known], np.sqrt(table.spread[known] + LIMITS.day_sd**2)
    posterior, bar = baseline_of(baseline, hanger, keys, level)
    before = _as_test("before", keys, level, np.full(len(keys), LIMITS.day_sd))
    reader = Reader(posterior, [before], bar)
    after = _as_test("after", keys, level + moved[known], sd)
    rows = [reader.reading(each, _NEVER).modes for each in (before, after)]
    modes = [each for each in rows if each is not None]
    options = WatchOptions.of(hanger.assumptions)
    structure = structure_of(reader.quantities, reader.columns, options)
    n = structure.layout.n
    columns = np.zeros((2, n, len(structure.layout.prior_sd)))
    columns[:, :, :n] = np.eye(n)
    columns[:, :, structure.layout.change][..., n:] = structure.slopes
    wander = wander_sd * columns[:, :, n]
    sums = sums_of(
        columns,
        np.array([each.values for each in modes]),
        np.array([each.variances for each in modes]),
        (wander[:, :, None] * wander[:, None] / 2)[:, None],
    )
    evidence = evidence_of(sums, np.array([0.0, 1.0]), 1, structure.layout, structure.directions)
    effects = effects_of(reader.modes, structure.slopes)
    subject = SummaryContext(reader.quantities, hanger, options, _NEVER, 0.0, *effects)
    found = rank_causes(subject, evidence)
    first = {found[0].quantity, *found[0].together}
    planes = {each.plane for each in found if each.quantity in first}
    by_mode = np.full(len(moved), np.median(moved[known])) if _is_clock(found) else moved
    return StreamCause(found, by_mode, planes.pop() if len(planes) == 1 else None)


def find_exchange(
    off: FloatArray,
    table: ModeTable,
    least: int = 3,
    within: float = 2.0,
    surely: float = 5.0,
    far: float = 5.0,
) -> StreamCause | None:
    """Return exchanged planes as the cause, if each mode lies where that of the other plane does.

    `off` (n,) are changes of ln f. In the median they are `within` so many sds of that, at the best
    tension, and all together likelier than where they were by log odds of `surely`. No mode counts
    for more than `far` sds.
    """
    place = {mode: index for index, mode in enumerate(table.modes)}
    other = [place.get((PLANES[plane == PLANES[0]], order), -1) for plane, order in table.modes]
    crossed = np.where(np.array(other) >= 0, table.level[other] - table.level, np.nan)
    both = np.isfinite(off + crossed)
    if both.sum() < least:
        return None
    tension, sd = table.tension[both], np.sqrt(table.spread[both])
    left, before = (
        np.abs(each - tension * np.median(each / tension)) / sd
        for each in ((off - crossed)[both], off[both])
    )
    odds = float(np.sum(before.clip(max=far) ** 2 - left.clip(max=far) ** 2)) / 2
    if not np.median(left) < within or not odds > surely:
        return None
    return StreamCause((Moved(EXCHANGED, 1.0, np.nan, np.nan),), crossed, None)


def _is_clock(moved: Sequence[Moved]) -> bool:
    """Return True if all modes moved alike, those too that sleep at night."""
    return moved[0].quantity == TIMEBASE


def _as_test(
    name: str, keys: Sequence[tuple[Plane, int]], log_hz: FloatArray, sd: FloatArray
) -> ModalTest:
    return ModalTest(
        name,
        tuple(
            Mode(plane, order, hz, its * hz)
            for (plane, order), hz, its in zip(
                keys, np.exp(log_hz).tolist(), sd.tolist(), strict=True
            )
        ),
    )
