"""Hanger 3: posterior and evidence of all five classes beside the thesis's tables 5.1 and 6.1."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from shm.inference import UpdateOptions, select
from shm.models import THESIS, build
from shm.values import Hanger, Posterior, Selection
from tests.benchmarks.thesis import thesis_data

_REPEATS = (1, 10)  # once, and N_D of the thesis's evidence (docs/trials/validation.md)


@dataclass(frozen=True)
class SelectionRow:
    """One model class on one printing of the measured table, counted N_D times.

    Log Bayes factors are to the best class of that choice.
    """

    printing: str
    repeat: int
    model: str
    probability: float
    log_evidence: float
    log_evidence_sd: float
    log_bayes_factor: float
    thesis_log_bayes_factor: float
    tension_kn: float
    tension_q05_kn: float
    tension_q95_kn: float
    deviation_from_nominal: float
    thesis_deviation: float
    most_probable: dict[str, float]
    nominal_tension_kn: float
    seconds: float

    @property
    def deviations(self) -> str:
        """Of the mean tension, from both nominal tensions of the thesis."""
        return self._from_both(self.tension_kn)

    @property
    def most_probable_deviations(self) -> str:
        """The same of the most probable tension: table 6.1 does not say which it means."""
        return self._from_both(self.most_probable["theta_F"] * self.nominal_tension_kn)

    def _from_both(self, tension_kn: float) -> str:
        other = thesis_data.OTHER_NOMINAL_TENSION_N / 1e3
        return f"{tension_kn / self.nominal_tension_kn - 1:+.0%} / {tension_kn / other - 1:+.0%}"


def compared(
    hanger: Hanger,
    seed: int,
    progress: Callable[[str, float], None],
    printings: Sequence[str] = tuple(thesis_data.PRINTINGS),
    repeats: Sequence[int] = _REPEATS,
) -> list[SelectionRow]:
    """All classes on the printings of the measured table, counted as often as each of `repeats`."""
    rows = []
    for printing in printings:
        for repeat in repeats:
            models = [build(name, hanger, THESIS) for name in thesis_data.EVIDENCE]
            options = UpdateOptions(samples=2000, seed=seed)
            label = f"{printing}, N_D = {repeat},"

            def tell(name: str, fraction: float, label: str = label) -> None:
                progress(f"{label} {name}", fraction)

            tests = thesis_data.measured_tests(printing, repeat)
            selection = select(tests, models, options, tell)
            rows += _selection_rows(printing, repeat, selection)
    return rows


def _selection_rows(printing: str, repeat: int, selection: Selection) -> list[SelectionRow]:
    best, thesis_best = selection.selected.log_evidence, max(thesis_data.EVIDENCE.values())
    return [
        _row(printing, repeat, posterior, probability, best, thesis_best)
        for posterior, probability in zip(
            selection.posteriors, selection.probabilities, strict=True
        )
    ]


def _row(
    printing: str,
    repeat: int,
    posterior: Posterior,
    probability: float,
    best: float,
    thesis_best: float,
) -> SelectionRow:
    low, high = np.quantile(posterior.tension_n, [0.05, 0.95])
    mean = float(posterior.tension_n.mean())
    return SelectionRow(
        printing=printing,
        repeat=repeat,
        model=posterior.model,
        probability=probability,
        log_evidence=posterior.log_evidence,
        log_evidence_sd=posterior.log_evidence_sd,
        log_bayes_factor=posterior.log_evidence - best,
        thesis_log_bayes_factor=thesis_data.EVIDENCE[posterior.model] - thesis_best,
        tension_kn=mean / 1e3,
        tension_q05_kn=float(low) / 1e3,
        tension_q95_kn=float(high) / 1e3,
        deviation_from_nominal=mean / posterior.nominal_tension_n - 1,
        thesis_deviation=thesis_data.DEVIATION_FROM_NOMINAL[posterior.model],
        most_probable=dict(zip(posterior.names, map(float, posterior.most_probable), strict=True)),
        nominal_tension_kn=posterior.nominal_tension_n / 1e3,
        seconds=posterior.seconds,
    )


HEADS = (
    "measured", "N_D", "class", "probability", "log evidence", "to best", "thesis, to best",
    "tension (kN), 90 % interval", "to 711 / 835 kN", "thesis",
    "most probable, to 711 / 835 kN", "time", "thesis, time", "most probable",
)  # fmt: skip


def cells(row: SelectionRow) -> tuple[str, ...]:
    """The row as texts under `HEADS`."""
    return (
        row.printing,
        str(row.repeat),
        row.model,
        f"{row.probability:.3f}",
        f"{row.log_evidence:.2f} ± {row.log_evidence_sd:.2f}",
        f"{row.log_bayes_factor:.1f}",
        f"{row.thesis_log_bayes_factor:.1f}",
        f"{row.tension_kn:.0f} ({row.tension_q05_kn:.0f} to {row.tension_q95_kn:.0f})",
        row.deviations,
        f"{row.thesis_deviation:+.0%}",
        row.most_probable_deviations,
        f"{row.seconds:.0f} s",
        thesis_data.EVALUATION_TIME[row.model],
        ", ".join(f"{name} {value:.3g}" for name, value in row.most_probable.items()),
    )


def misses(rows: list[SelectionRow]) -> list[str]:
    """Where the evidence does not prefer springs to fixed ends, class by class."""
    evidence = {(row.printing, row.repeat, row.model): row.log_evidence for row in rows}
    return [
        f"{printing}, N_D = {repeat}: {fixed} beats {springs}"
        for fixed, springs in (("beam1", "beam2"), ("solid0", "solid2"))
        for printing in thesis_data.PRINTINGS
        for repeat in _REPEATS
        if evidence[printing, repeat, fixed] > evidence[printing, repeat, springs] - 1
    ]
