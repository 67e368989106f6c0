"""What the runs of one sampler add up to, as tables for the terminal and for the docs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from docs.filling import write_csv
from tests.helpers import sharp_oracle
from tests.helpers.evidence_oracle import ORACLE

EVIDENCE = {
    **{("thesis", repeat): ORACLE["1.1", "beam2", repeat] for repeat in (1, 10)},
    **{("sharp", repeat): value for repeat, value in sharp_oracle.ORACLE.items()},
}
"""By quadrature; (problem, N_D): log evidence."""

FEWEST_RUNS = 5
LARGEST_BIAS = 0.2
LARGEST_SPREAD = 0.3
TIMES_FASTER = 30
OURS = "shm"
TITLES = {
    OURS: "**shm**",
    "dynesty": "dynesty, static",
    "dynesty_dynamic": "dynesty, dynamic",
    "dynesty_walks": "dynesty, random walks",
    "ultranest": "ultranest",
    "nautilus": "nautilus",
    "emcee": "emcee",
}
COLUMNS = (
    "sampler", "sigma", "runs", "processor time s", "times ours", "evaluations", "log evidence",
    "bias", "spread", "claimed", "effective samples", "ms an effective sample",
    "theta_F", "evidence is",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """Which data, how often they count, and whether sigma is sampled or integrated out."""

    problem: str
    repeat: int
    sigma: str

    @property
    def data(self) -> tuple[str, int]:
        """By what its evidence is known."""
        return self.problem, self.repeat

    def __str__(self) -> str:
        return f"{self.problem}, N_D = {self.repeat}, sigma {self.sigma}"


@dataclass(frozen=True)
class Summary:
    """Medians over the seeds of one sampler in one case; NaN where there is nothing to say."""

    peer: str
    case: Case
    version: str
    runs: int
    failures: tuple[str, ...]
    cpu_seconds: float
    evaluations: float
    log_evidence: float
    bias: float
    spread: float
    claimed: float
    effective_samples: float
    theta_f: float
    theta_f_spread: float

    @property
    def right(self) -> bool:
        """Whether the evidence is right: enough runs, small bias, small spread."""
        close = abs(self.bias) <= LARGEST_BIAS and self.spread <= LARGEST_SPREAD
        return close and self.runs >= FEWEST_RUNS

    @property
    def verdict(self) -> str:
        """The evidence in a word."""
        if not self.runs:
            return "-"
        if np.isnan(self.log_evidence):
            return "not given"
        if self.runs < FEWEST_RUNS:
            return f"open: {self.runs} of {FEWEST_RUNS} runs"
        return "right" if self.right else "wrong"


def summarised(rows: Sequence[dict[str, Any]]) -> list[Summary]:
    """One summary for each sampler and case, in the order of TITLES."""
    groups: dict[tuple[str, Case], list[dict[str, Any]]] = {}
    for row in rows:
        case = Case(row["problem"], row["repeat"], row["sigma"])
        groups.setdefault((row["peer"], case), []).append(row)
    summaries = [_summary(*key, group) for key, group in groups.items()]
    cases, peers = list(EVIDENCE), list(TITLES)
    return sorted(
        summaries,
        key=lambda s: (cases.index(s.case.data), peers.index(s.peer), s.case.sigma),
    )


def _summary(peer: str, case: Case, rows: Sequence[dict[str, Any]]) -> Summary:
    done = [row for row in rows if "failure" not in row]
    evidence, theta_f = _column(done, "log_evidence"), _column(done, "theta_f")
    return Summary(
        peer=peer,
        case=case,
        version=done[0]["version"] if done else "",
        runs=len(done),
        failures=tuple(row["failure"] for row in rows if "failure" in row),
        cpu_seconds=_median(_column(done, "cpu_seconds")),
        evaluations=_median(_column(done, "evaluations")),
        log_evidence=_median(evidence),
        bias=_median(evidence) - EVIDENCE[case.data],
        spread=_spread(evidence),
        claimed=_median(_column(done, "log_evidence_sd")),
        effective_samples=_median(_column(done, "effective_samples")),
        theta_f=_median(theta_f),
        theta_f_spread=_spread(theta_f),
    )


def _column(rows: Sequence[dict[str, Any]], name: str) -> np.ndarray:
    values = [row[name] for row in rows]
    return np.array([np.nan if value is None else value for value in values], dtype=float)


def _median(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else float("nan")


def _spread(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.std(ddof=1)) if len(finite) > 1 else float("nan")


def _cells(summary: Summary, ours: float) -> list[str]:
    runs = f"{summary.runs} of {summary.runs + len(summary.failures)}"
    per_sample = 1e3 * summary.cpu_seconds / summary.effective_samples
    return [
        f"{TITLES[summary.peer]} {summary.version}".strip(),
        summary.case.sigma,
        runs if summary.failures else str(summary.runs),
        _number(summary.cpu_seconds, ".3g"),
        _number(summary.cpu_seconds / ours, ".0f"),
        _number(summary.evaluations, ",.0f"),
        _number(summary.log_evidence, ".2f"),
        _number(summary.bias, "+.2f"),
        _number(summary.spread, ".2f"),
        _number(summary.claimed, ".2f"),
        _number(summary.effective_samples, ",.0f"),
        _number(per_sample, ".3g"),
        f"{_number(summary.theta_f, '.3f')} ± {_number(summary.theta_f_spread, '.3f')}",
        summary.verdict,
    ]


def _number(value: float, form: str) -> str:
    return "-" if np.isnan(value) else format(value, form)


def _our_seconds(summaries: Sequence[Summary], data: tuple[str, int]) -> float:
    found = [s.cpu_seconds for s in summaries if s.peer == OURS and s.case.data == data]
    return found[0] if found else float("nan")


def _tables(rows: Sequence[dict[str, Any]]) -> dict[tuple[str, int], list[list[str]]]:
    summaries = summarised(rows)
    return {
        data: [_cells(s, _our_seconds(summaries, data)) for s in summaries if s.case.data == data]
        for data in dict.fromkeys(s.case.data for s in summaries)
    }


def _title(data: tuple[str, int]) -> str:
    problem, repeat = data
    return f"{problem.capitalize()}, N_D = {repeat}"


def show(rows: Sequence[dict[str, Any]], console: Console) -> None:
    """Prints a table for each problem and N_D, and what failed."""
    for data, lines in _tables(rows).items():
        table = Table(*COLUMNS, title=f"{_title(data)}, log evidence {EVIDENCE[data]:.2f}")
        for cells in lines:
            table.add_row(*cells)
        console.print(table)
    for line in failures(rows):
        console.print(line)


def failures(rows: Sequence[dict[str, Any]]) -> list[str]:
    """A sentence for each sampler and case with failed runs."""
    return [
        f"{TITLES[s.peer]}, {s.case}: {len(s.failures)} of "
        f"{s.runs + len(s.failures)} runs failed ({'; '.join(sorted(set(s.failures)))})."
        for s in summarised(rows)
        if s.failures
    ]


def write_docs(rows: Sequence[dict[str, Any]], page: Path) -> None:
    """Puts the tables between the page's marks; the text around them stays."""
    text = page.read_text(encoding="utf-8")
    before, rest = text.split("<!-- peers -->")
    after = rest.split("<!-- /peers -->")[1]
    parts = []
    for data, lines in _tables(rows).items():
        name = "{}_n_d_{}.csv".format(*data)
        write_csv(page.with_suffix("") / name, [COLUMNS, *lines])
        parts.append(f"{_in_short(data, lines)} ([All figures]({page.stem}/{name}).)")
    parts += [*failures(rows)]
    inside = "\n".join(f"- {part}" for part in parts)
    page.write_text(f"{before}<!-- peers -->\n{inside}\n<!-- /peers -->{after}", encoding="utf-8")


def _in_short(data: tuple[str, int], lines: Sequence[Sequence[str]]) -> str:
    """Of each sampler how long it took, how far its evidence is off, and the verdict."""
    told = []
    for cells in lines:
        row = dict(zip(COLUMNS, cells, strict=True))
        if row["processor time s"] == "-":
            told.append(f"{row['sampler']} did not end")
            continue
        bias = "evidence" if row["bias"] == "-" else f"bias {row['bias']},"
        told.append(f"{row['sampler']} {row['processor time s']} s, {bias} {row['evidence is']}")
    return f"**{_title(data)}**, log evidence {EVIDENCE[data]:.2f}: {'; '.join(told)}."


def failed_bounds(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Which bounds fail: our evidence, and our lead over each peer whose evidence is right."""
    summaries, failed = summarised(rows), []
    for summary in summaries:
        ours = _our_seconds(summaries, summary.case.data)
        where = f"{summary.peer}, {summary.case}"
        if summary.peer == OURS and not summary.right:
            failed.append(f"{where}: bias {summary.bias:+.2f}, spread {summary.spread:.2f}")
        elif summary.right and summary.peer != OURS:
            times = summary.cpu_seconds / ours
            failed += [f"{where}: only {times:.0f} times ours"] if times < TIMES_FASTER else []
    return failed
