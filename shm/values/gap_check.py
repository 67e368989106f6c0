"""Results of a gap check: causes that a diagnosis finds on simulated twins of a hanger."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from shm.values.kinds import NAN
from shm.values.showing import Displayable

Outcome = Literal["alone", "in a group", "another cause", "no gap", "unexplained", "refused"]
"""What the verdict says of a planted effect; `refused` if no explanation comes near the data."""


@dataclass(frozen=True)
class PlantedParameter:
    """A parameter of a planted effect, its value in `unit`."""

    name: str
    unit: str
    value: float


@dataclass(frozen=True)
class GapTrial:
    """The diagnosis of one twin with one effect, or with none (`effect` empty, `step` -1).

    `step` counts the sizes from the smallest. `others` are the effects that the diagnosis claims
    in the place of the planted one or together with it; `probability` is that of the claim.
    """

    effect: str
    at: str
    step: int
    parameters: tuple[PlantedParameter, ...]
    seed: int
    outcome: Outcome
    others: tuple[str, ...] = ()
    probability: float = NAN
    seconds: float = NAN

    @property
    def is_found(self) -> bool:
        """Return True if the effect is the claimed cause or one of those claimed together."""
        return self.outcome in ("alone", "in a group")


@dataclass(frozen=True)
class EffectCheck:
    """From which size on an effect is found.

    `sizes` are those of `name` in `unit`, the weakest first. `found_from` is the index of the
    smallest that is found in at least half of the searches, one a seed; None if none is.
    """

    effect: str
    name: str
    unit: str
    sizes: tuple[float, ...]
    found_from: int | None
    trials: tuple[GapTrial, ...]

    @property
    def size(self) -> float:
        """Return the smallest size that is found; NaN if none is."""
        return NAN if self.found_from is None else self.sizes[self.found_from]

    @property
    def alone_from(self) -> int | None:
        """Return the smallest size that is found alone in at least half of its trials."""
        tried: dict[int, list[bool]] = {}
        for trial in self.trials:
            tried.setdefault(trial.step, []).append(trial.outcome == "alone")
        return min((s for s, alone in tried.items() if 2 * sum(alone) >= len(alone)), default=None)

    @property
    def others(self) -> tuple[str, ...]:
        """Return the effects that are found together with this one at its smallest size."""
        return _named(t for t in self.trials if t.step == self.found_from and t.is_found)

    @property
    def missed(self) -> tuple[GapTrial, ...]:
        """Return the trials of the largest size that was missed in one of them."""
        lost = [trial for trial in self.trials if not trial.is_found]
        top = max((trial.step for trial in lost), default=-1)
        return tuple(trial for trial in lost if trial.step == top)

    @property
    def taken_for(self) -> tuple[str, ...]:
        """Return the effects that the largest missed size is taken for."""
        return _named(trial for trial in self.missed if trial.outcome == "another cause")


@dataclass(frozen=True)
class GapCheck(Displayable):
    """Effects that a diagnosis of these tests would find, and from which size on.

    The twin is the class `baseline` fitted to the tests (`tests` empty: the description with a
    usual hammer test), with the tension `tension_n`; the fit misses their frequencies by
    `misfit_percent`. Frequencies err by `frequency_sd_percent`, as stated or, where nothing is, as
    assumed. `sound` are trials of twins without an effect. `invisible` names effects that
    these data cannot show, and why. `searches` were asked for; fewer are done if it was stopped.
    """

    hanger: int | None
    baseline: str
    tests: tuple[str, ...]
    tension_n: float
    misfit_percent: float
    frequency_sd_percent: float
    effects: tuple[EffectCheck, ...]
    sound: tuple[GapTrial, ...]
    invisible: tuple[tuple[str, str], ...]
    searches: int
    searches_done: int
    seeds: int
    seed: int

    @property
    def is_complete(self) -> bool:
        """Return True if it was not stopped."""
        return self.searches_done == self.searches

    @property
    def false_gaps(self) -> int:
        """Return the number of sound twins in which a gap is claimed."""
        return sum(trial.outcome != "no gap" for trial in self.sound)


def _named(trials: Iterable[GapTrial]) -> tuple[str, ...]:
    """Return the other effects of some trials, each once."""
    return tuple(dict.fromkeys(name for trial in trials for name in trial.others))
