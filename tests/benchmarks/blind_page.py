"""Write what `blind_trial.py` reached: figures, a table of hangers, docs/trials/blind_trial.md."""

from __future__ import annotations

import gzip
import shutil
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from docs.filling import fill_in, write_csv
from shm.documents import dump
from shm.values import Outcome
from tests.benchmarks.blind_scores import (
    CLAIMS,
    Row,
    find_contradictions,
    score,
    table,
)
from tests.benchmarks.shares import interval

TRIALS = Path(__file__).resolve().parents[2] / "docs" / "trials"
BESIDE, SEALED = "blind_trial/hangers.csv", "blind_trial/truth.json"
ANSWERS = TRIALS / "blind_trial" / "answers.json.gz"
"""The answers as documents, which `tests/report/test_verdict_agrees.py` reads."""
RIGHT, WRONG, GREY = "#1b6ca8", "#c0392b", "#8a8a8a"
PERCENT = -30, -10, -3, -1, 0, 1, 3, 10, 30, 100
PROBABILITIES = 0.0, 0.5, 0.7, 0.8, 0.9, 1.0
NO_GAP, NOT_EXPLAINED, SOUND = "no gap", "not explained", "sound"
HEAD = (
    "hanger", "world", "kind", "class", "true cause left out", "planted (largest change, sd)",
    "answer", "named", "probability", "right", "tension before, %", "tension after, %",
    "95 % interval holds", "processor s", "contradictions",
)  # fmt: skip


def describe_planted(row: Row) -> str:
    """Return `sag (12)`, or `sound`."""
    each = [f"{cause['cause']} ({cause['visible']:.0f})" for cause in row.truth["causes"]]
    return " + ".join(each) or SOUND


def describe_answer(row: Row) -> str:
    """Return the effects that the verdict names first, or that it names none."""
    if row.diagnosis is None or row.outcome is None:
        return "refused"
    if row.diagnosis.verdict.claim is not None:
        return row.diagnosis.verdict.claim.leading.effect
    return NO_GAP if row.outcome is Outcome.NO_GAP else NOT_EXPLAINED


def list_hanger(row: Row) -> tuple[str, ...]:
    """Return the hanger's row of the table of all."""
    truth, found = row.truth, row.diagnosis
    head = (truth["hanger"], truth["world"], truth["kind"])
    left_out = "yes" if row.is_without else "no"
    seconds = f"{row.answer['processor_s']:.0f}"
    if found is None or row.outcome is None:
        refused = (describe_planted(row), "refused", *[""] * 6, seconds, "")
        return (*head, "", left_out, *refused)
    return (
        *head,
        found.baseline,
        left_out,
        describe_planted(row),
        row.outcome.value,
        describe_answer(row) if row.outcome in CLAIMS else "",
        f"{row.probability:.3f}",
        "yes" if row.is_right else "no",
        *(f"{100 * row.error(when):+.2f}" for when in ("before", "after")),
        "yes" if row.holds else "no",
        seconds,
        "; ".join(find_contradictions(found)),
    )


# ---------------------------------------------------------------- figures


def draw_reliability(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw how often a cause or no gap is right over the probability that the answer states."""
    axes.plot([0, 1], [0, 1], color=GREY, linewidth=1, label="as stated")
    stated = np.array([row.probability for row in rows])
    right = np.array([row.is_right for row in rows])
    for low, high in pairwise(PROBABILITIES):
        chosen = (stated > low) & (stated <= high)
        n, k = int(chosen.sum()), int(right[chosen].sum())
        if not n:
            continue
        x, (bottom, top) = float(stated[chosen].mean()), interval(k, n)
        axes.errorbar(x, k / n, [[k / n - bottom], [top - k / n]], fmt="o", color=RIGHT, capsize=3)
        axes.annotate(
            f"{k} of {n}", (x, k / n), (-5, 4), textcoords="offset points", ha="right", fontsize=8
        )
    axes.set(xlim=(0, 1.02), ylim=(-0.03, 1.08), xlabel="probability that the answer states")
    axes.set(ylabel="fraction right, 90 % interval", title="Do the probabilities hold?")
    axes.legend(loc="upper left", frameon=False)


def draw_confusion(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw what was planted against what the verdict names first."""

    def planted(row: Row) -> str:
        causes = [each["cause"] for each in row.truth["causes"]]
        return causes[0] if len(causes) == 1 else "two causes" if causes else SOUND

    def said(row: Row) -> str:
        true = row.first & set(row.truth["accepted"])
        return min(true) if true else describe_answer(row)

    up = sorted({planted(row) for row in rows} - {"two causes", SOUND})
    up += [each for each in ("two causes", SOUND) if any(planted(row) == each for row in rows)]
    accepted = {planted(row): row.truth["accepted"] for row in rows}
    order = {name: n for n, each in enumerate(up) for name in accepted[each]}
    last = (NO_GAP, NOT_EXPLAINED, "refused")
    across = sorted({said(row) for row in rows} - set(last), key=lambda e: (order.get(e, 99), e))
    across += [each for each in last if any(said(row) == each for row in rows)]
    for y, name in enumerate(up):
        for x, effect in enumerate(across):
            cell = [row for row in rows if (planted(row), said(row)) == (name, effect)]
            if cell:
                good = sum(row.is_right for row in cell)
                colour = RIGHT if good == len(cell) else WRONG if not good else GREY
                axes.scatter(x, y, 260, color=colour, alpha=0.85)
                axes.annotate(
                    str(len(cell)), (x, y), color="white", ha="center", va="center", fontsize=9
                )
    labels = [each.replace("_", " ").replace(" + ", "\n+ ") for each in across]
    axes.set_xticks(range(len(across)), labels, rotation=90, fontsize=9)
    axes.set_yticks(range(len(up)), up)
    axes.set(xlim=(-0.7, len(across) - 0.3), ylim=(len(up) - 0.3, -0.7))
    axes.set(ylabel="planted", title="What was planted and what the verdict names first")
    axes.grid(alpha=0.25)
    for colour, label in ((RIGHT, "right"), (WRONG, "wrong or missed"), (GREY, "some right")):
        axes.scatter([], [], 80, color=colour, label=label)
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1), frameon=False)


def draw_intervals(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw the 95 % interval of each tension relative to the truth, the narrowest first."""

    lines = []
    for row in rows:
        if row.diagnosis is None:
            continue
        before_n, after_n = row.diagnosis.tension_before_n, row.diagnosis.tension_after_n
        tensions_n = np.array([before_n.mean, after_n.mean, after_n.q025, after_n.q975])
        lines.append((*(100 * (tensions_n / row.truth["tension_n"] - 1)).tolist(), row.holds))
    ordered = sorted(lines, key=lambda line: line[3] - line[2])
    for y, (before, after, low, high, holds) in enumerate(ordered):
        colour = RIGHT if holds else WRONG
        axes.plot([low, high], [y, y], color=colour, linewidth=2)
        axes.plot(after, y, "o", color=colour, markersize=4)
        axes.plot(before, y, "x", color=GREY, markersize=4)
    axes.axvline(0, color="black", linewidth=0.8)
    axes.set_xscale("symlog", linthresh=1)
    axes.set_xticks(PERCENT, [f"{each:+g}" if each else "0" for each in PERCENT])
    axes.set_xticks([], minor=True)
    axes.set_yticks([])
    axes.set(xlabel="tension over the truth, less one, % (logarithmic beyond 1 %)")
    axes.set(title="Tension: 95 % interval after the diagnosis (cross: mean before)")
    for colour, label in ((RIGHT, "holds the truth"), (WRONG, "misses it")):
        axes.plot([], [], color=colour, linewidth=2, label=label)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=2, frameon=False)


def save_figures(rows: Sequence[Row], folder: Path) -> list[str]:
    """Save the three figures; return their names."""
    done = [row for row in rows if row.diagnosis]
    full = [row for row in done if not row.is_without]
    stated = [row for row in done if row.outcome is not Outcome.UNEXPLAINED]
    names = []
    for name, size, draw, chosen in (
        ("blind_reliability", (5.5, 4.5), draw_reliability, stated),
        ("blind_confusion", (11.0, 7.5), draw_confusion, full),
        ("blind_interval", (7.5, 7.0), draw_intervals, done),
    ):
        figure, axes = plt.subplots(figsize=size, layout="constrained")
        draw(axes, chosen)
        figure.savefig(folder / f"{name}.png", dpi=110)
        plt.close(figure)
        names.append(f"{name}.png")
    return names


def keep_answers(rows: Sequence[Row]) -> None:
    """Keep the diagnoses, without the profiles of places, which nobody compares."""
    answers = {}
    for row in rows:
        if (found := row.answer.get("diagnosis")) is not None:
            name = f"{row.truth['hanger']}{', true cause left out' if row.is_without else ''}"
            places = [{**each, "profile": []} for each in found["places"]]
            answers[name] = {**found, "places": places}
    ANSWERS.write_bytes(gzip.compress(dump(answers).encode(), mtime=0))


def write_page(rows: Sequence[Row], trial: dict[str, object], truth: Path) -> None:
    """Fill in the page of the trial, its figures and its table; keep sealed file and answers."""
    reliability, confusion, intervals = save_figures(rows, TRIALS / "figures")
    write_csv(TRIALS / BESIDE, [HEAD, *(list_hanger(row) for row in rows)])
    shutil.copyfile(truth, TRIALS / SEALED)
    keep_answers(rows)
    full = sum(not row.is_without for row in rows)
    sound = sum(row.is_sound for row in rows if not row.is_without)
    text = (
        f"{full} hangers, {sound} of them sound, and {len(rows) - full} of them once more without "
        f"the true cause; seed {trial['seed']}, commit {str(trial['commit'])[:8]}; SHA-256 of the "
        f"truth `{trial['truth_sha256']}`.\n\n{table(score(rows))}\n\n"
        f"[Every hanger]({BESIDE}), [the file that was sealed]({SEALED}).\n\n"
        f"![Fraction right over the probability stated](figures/{reliability})\n\n"
        f"![Planted causes against those named](figures/{confusion})\n\n"
        f"![The 95 % interval of each tension](figures/{intervals})"
    )
    fill_in(TRIALS / "blind_trial.md", "blind trial", text)
