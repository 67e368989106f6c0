"""The registry of steps: which function of `shm.pipeline.steps` does a kind of job, with its type.

They are loaded by whoever begins or computes one. With them `import shm.pipeline.flow` takes 0.72 s
of processor time instead of 0.42 s (medians of 7).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ParamSpec, TypeAlias, TypeVar

from shm.resources import give_back_memory

if TYPE_CHECKING:
    from shm.bridge import Bridge
    from shm.pipeline.lineage import Terms
    from shm.pipeline.remote_file import Opens
    from shm.settings import Settings
    from shm.store import Baseline, IdentifiedTest, StoredRecording
    from shm.values import (
        Alert,
        Averaged,
        Beside,
        Hanger,
        ModalTest,
        Posterior,
        Selection,
        WatchedTest,
    )
    from shm.watch import DatedTest
    from shm.watch.agreement import Way

WatchResult: TypeAlias = "tuple[WatchedTest, Alert | None, bytes, frozenset[tuple[str, Way]]]"
"""What the watch says, the alert that it calls for, what to keep, and what stands beyond its
threshold."""

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True)
class Steps:
    """By kind of job. Functions of plain values alone: a process elsewhere can be sent them."""

    identify: Callable[
        [StoredRecording, Opens, Bridge, Settings, Mapping[int, str]], tuple[IdentifiedTest, ...]
    ]
    select: Callable[[Sequence[ModalTest], Hanger, Sequence[str], Terms], Selection]
    update: Callable[[ModalTest, Hanger, str, Posterior | None, Terms], Posterior]
    watch: Callable[
        [
            Baseline,
            tuple[Sequence[DatedTest], Sequence[DatedTest]],
            Posterior,
            Hanger,
            float,
            bytes | None,
            Averaged | None,
            Beside | None,
        ],
        WatchResult | None,
    ]


def registered() -> Steps:
    """The steps, loaded."""
    from shm.pipeline import steps

    return Steps(steps.identify_file, steps.select_model, steps.update_test, steps.watch_test)


def run_step(step: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
    """What a step gives; the process that ran it gives back the memory that it has freed."""
    try:
        return step(*arguments, **named)
    finally:
        give_back_memory()
