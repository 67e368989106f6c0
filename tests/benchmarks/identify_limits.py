"""How near sound and disturbed simulated tests come to the limits of `identify` and of its checks.

    python tests/benchmarks/identify_limits.py --sound 60 --faulty 10 --write-docs

Each limit parts what is left alone from what is left out or flagged. The table gives, of values in
sound tests, the one nearest to it (or beyond), the 1 % and the median, with their number; and the
same of the worst values of tests with the fault it is there for.
"""

from __future__ import annotations

import importlib
from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import Any

import begin
import numpy as np
from cases import Case, random_case

from docs.filling import fill_in
from shm.errors import NotIdentifiable
from shm.identify import identify
from shm.identify.measuring import screening, signal_faults
from shm.identify.mode_ordering import foreign
from shm.identify.quality import of_hits, of_modes, of_signals
from shm_cli.common import markdown

tones = importlib.import_module("shm.identify.quality.tones")  # the name is also a function's
FAULTS = ("clipping", "overload", "outlier_hit", "mains", "machine", "soft_hit")
TONES = ("mains", "machine")
SEED = 22
Seen = dict[str, list[float]]


class Watch:
    """What the functions that hold the limits were given, by quantity, in one test."""

    def __init__(self) -> None:
        self.seen: Seen = defaultdict(list)
        self.tones_hz: list[float] = []
        self._spy(screening, "outliers", self._apart)
        self._spy(signal_faults, "_wanders", self._wandering)
        self._spy(signal_faults, "_plain_faults", self._silence)
        self._spy(signal_faults, "_is_crowded", self._crowd)
        self._spy(tones, "_is_tone", self._tone)
        self._spy(foreign, "_is_steady", self._damping)

    def test(self, case: Case) -> Seen:
        """The quantities of one test."""
        self.seen = defaultdict(list)
        planted = [p.frequency_hz for p in case.made.planted if p.disturbance in TONES]
        self.tones_hz = [fold * f for f in planted if np.isfinite(f) for fold in range(1, 9)]
        try:
            found = identify([case.made.recording], test_id="t", hanger=case.hanger)
        except NotIdentifiable:
            return self.seen
        for check in found.quality:
            self.seen[check.name].append(check.value)
        return self.seen

    def _spy(self, module: Any, name: str, look: Callable[..., None]) -> None:
        own = getattr(module, name)

        def spied(*given: Any) -> Any:
            look(*given)
            return own(*given)

        setattr(module, name, spied)

    def _apart(self, apart: Any) -> None:
        known = apart[np.isfinite(apart)]
        if len(known) >= screening.FEWEST_TO_COMPARE:
            self.seen["hit unlike the others"] += known.tolist()
            beyond = known[known > signal_faults.MOST_UNLIKE]
            self.seen["the same over its median"] += (beyond / np.median(known)).tolist()

    def _wandering(self, free: Sequence[Any], _known: Any, rate_hz: float) -> None:
        block = max(1, int(signal_faults._OFFSET_SECONDS * rate_hz))
        for part in free:
            blocks = part.shape[1] // block
            if blocks >= 2:
                parts = part[:, : blocks * block].reshape(len(part), blocks, block)
                level = np.maximum(parts.std(axis=2).max(axis=1), np.finfo(float).tiny)
                self.seen["offset over ringing"] += (
                    np.ptp(parts.mean(axis=2), axis=1) / level
                ).tolist()

    def _silence(self, cut: Any) -> None:
        moves = np.ptp(cut, axis=1)
        if np.all(np.isfinite(moves)) and np.all(moves > 0):
            self.seen["channel over the median one"] += (moves / np.median(moves)).tolist()

    def _crowd(self, values: Any, repeats: int) -> None:
        highest = np.sort(values)[-signal_faults._TOP :]
        steps = np.diff(highest)
        if np.any(steps > 0):
            reach = (signal_faults._LEVELS_BELOW + 0.5) * steps[steps > 0].min()
            below = np.sum((highest < highest[-1]) & (highest >= highest[-1] - reach))
            self.seen["top level over those below"].append(
                repeats * signal_faults._LEVELS_BELOW / max(1, int(below))
            )

    def _is_planted(self, frequency_hz: float) -> bool:
        return any(abs(frequency_hz / tone - 1) < 0.002 for tone in self.tones_hz)

    def _tone(self, frequency_hz: float, parts: Any, _options: Any) -> None:
        turns = frequency_hz / parts.rate_hz
        amplitudes = np.array([part.amplitude(turns) for part in parts.later])
        weights = np.array([part.weight for part in parts.later])
        weights = weights / weights.sum()
        kind = "tone" if self._is_planted(frequency_hz) else "mode"
        steady = tones._steadiness(weights, amplitudes)
        self.seen[f"steadiness of a {kind}"].append(steady)
        if parts.before is not None:
            mean = weights @ amplitudes
            change = np.sum(np.abs(parts.before.amplitude(turns) - mean) ** 2)
            self.seen[f"change before the first hit of a {kind}"].append(
                float(change / np.sum(np.abs(mean) ** 2))
            )

    def _damping(self, mode: Any, modes: Sequence[Any]) -> None:
        others = [each.damping_ratio for each in modes if each is not mode]
        if others:
            kind = "tone" if self._is_planted(mode.frequency_hz) else "mode"
            ratio = mode.damping_ratio / float(np.median(others))
            self.seen[f"damping of a {kind} over the others'"].append(ratio)


# Quantity, its limit, whether sound tests lie above it, and the faults it is there for.
LIMITS = (
    ("hit unlike the others", signal_faults.MOST_UNLIKE, False, ("outlier_hit",)),
    ("the same over its median", screening._TIMES_OTHERS, False, ("outlier_hit",)),
    ("offset over ringing", signal_faults._OFFSET_MOVES, False, ()),
    ("channel over the median one", signal_faults._SILENT_SHARE, True, ()),
    ("top level over those below", signal_faults._CROWDED, False, ("clipping", "overload")),
    ("coherence", of_modes._WARNING, True, ()),
    ("ring-down", of_hits._RUNG_DOWN_DB, False, ()),
    ("force spectrum", of_hits._LEAST_FORCE_DB, True, ("soft_hit",)),
    ("noise", of_signals._WARNING_DB, True, ()),
)
# Of a mode of any test, and of a planted tone: quantity, limit, whether modes lie above it.
OF_TONES = (
    ("steadiness of a {}", tones._STEADY, False),
    ("change before the first hit of a {}", tones._SAME_BEFORE, True),
    ("damping of a {} over the others'", foreign._STEADY, True),
)


def told(values: Sequence[float], above: bool) -> str:
    """The extreme, and the 1 in 100, of values that should lie above or below."""
    known = np.array([value for value in values if np.isfinite(value)])
    if not len(known):
        return "-"
    ends = np.quantile(known, (0.0, 0.01, 0.5) if above else (1.0, 0.99, 0.5))
    return f"{ends[0]:.3g}, {ends[1]:.3g}, {ends[2]:.3g} ({len(known)})"


def main() -> None:
    given = begin.options(
        __doc__, sound=60, faulty=begin.Told(10, "tests with each fault"), write_docs=False
    )
    watch, by_fault = Watch(), defaultdict[str, list[Seen]](list)
    sound = [number for number in range(2 * given.sound) if number % 10 not in (3, 8)]
    for number in sound[: given.sound]:
        by_fault["sound"].append(watch.test(random_case(SEED, number)))
    for fault in FAULTS:
        for number in range(given.faulty):
            by_fault[fault].append(watch.test(random_case(SEED, 1000 + number, fault)))

    def values(name: str, faults: Sequence[str]) -> list[float]:
        return [v for fault in faults for test in by_fault[fault] for v in test.get(name, [])]

    def worst(name: str, faults: Sequence[str], above: bool) -> list[float]:
        pick = min if above else max
        tests = [test[name] for fault in faults for test in by_fault[fault] if test.get(name)]
        return [pick(each) for each in tests]

    rows = [
        [name, f"{limit:g}", told(values(name, ["sound"]), above),
         told(worst(name, faults, above), not above), ", ".join(faults)]
        for name, limit, above, faults in LIMITS
    ]  # fmt: skip
    everything = ["sound", *FAULTS]
    rows += [
        [name.format("mode"), f"{limit:g}", told(values(name.format("mode"), everything), above),
         told(values(name.format("tone"), everything), not above), ", ".join(TONES)]
        for name, limit, above in OF_TONES
    ]  # fmt: skip
    text = markdown(["quantity", "limit", "sound", "faulty", "fault"], rows)
    head = f"{given.sound} sound tests and {given.faulty} with each fault, seed {SEED}."
    print(f"{head}\n\n{text}")
    if given.write_docs:
        fill_in(begin.TRIALS / "identification_benchmarks.md", "limits", f"{head}\n\n{text}")


if __name__ == "__main__":
    main()
