"""`shm gap blind`: the gap diagnosis on cases whose cause it is not told."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import rich_click as click

from shm.blind.layout import Told, key_beside, read_trial
from shm.errors import GateNotMet
from shm_cli import flags
from shm_cli.common import answer, counting_bar, readable_width, show, show_rows

if TYPE_CHECKING:
    from shm.blind.making import MadeTrial
    from shm.blind.solving import SolvedRound
    from shm.values import TrialScore

_trial_argument = click.argument("directory", metavar="DIR", type=flags.FOLDER)
# Technical: more processes than that are a mistake of typing.
_jobs_option = click.option(
    "--jobs",
    type=click.IntRange(1, 256),
    default=os.cpu_count() or 1,
    show_default="all processors",
    metavar="N",
    help="How many processes work at once; it changes nothing but the time.",
)


def _key_type() -> click.Path:
    return click.Path(dir_okay=False, path_type=Path)


@click.group()
def blind() -> None:
    """Try the diagnosis on cases whose cause it is not told: make, solve, score.

    \b
    Example: shm gap blind solve trial
    """


@blind.command()
@_trial_argument
@click.option("--cases", type=click.IntRange(1, 9999), default=300, help="How many.")
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    show_default="one that nobody can guess",
    help="Random seed; who knows it can make the key again.",
)
@click.option(
    "--key",
    type=_key_type(),
    metavar="FILE",
    show_default="DIR.key.json",
    help="Where the key is written: outside of DIR.",
)
@click.option(
    "--way",
    type=click.Choice(["both", "modes", "recordings"]),
    default="both",
    help="Cases hold modal tests, or recordings that are still to be identified, or half of each.",
)
@_jobs_option
@flags.json
def make(
    directory: Path,
    cases: int,
    seed: int | None,
    key: Path | None,
    way: str,
    jobs: int,
) -> None:
    """Make a trial: hangers with hidden causes, and a key that is kept apart.

    A quarter of the cases has no gap, half has one effect of the catalogue, an eighth two, and an
    eighth something that the catalogue lacks. No file of DIR tells which.

    \b
    Example: shm gap blind make --cases 300 trial --key keys/trial.key.json
    """
    from shm.blind.making import WAYS, make_trial

    key = key or key_beside(directory)
    ways = [each for each in WAYS if way in ("both", each)]
    with _told("making") as told:
        made = make_trial(directory, key, cases, seed=seed, ways=ways, jobs=jobs, told=told)
    if flags.wants_json():
        told_of = {"directory": str(directory), "cases": len(made.cases), "key": str(key)}
        show({**told_of, "key_sha256": made.key_sha256})
        return
    _show_made(made, directory, key)


def _show_made(made: MadeTrial, directory: Path, key: Path) -> None:
    ways = ("modes", "recordings")
    counts: Counter[tuple[str, str]] = Counter((case.kind, case.way) for case in made.cases)
    rows = [(words, *(str(counts[kind, way]) for way in ways)) for kind, words in _PLANTED.items()]
    show_rows(f"{len(made.cases)} cases in {directory}", ("planted", *ways), rows)
    click.echo(f"Key: {key}")
    click.echo(f"Its SHA-256: {made.key_sha256}")
    click.echo(f"Keep the key away from whoever solves. Next: shm gap blind solve {directory}")


_PLANTED = {
    "none": "nothing",
    "one": "one effect",
    "two": "two effects",
    "unknown": "not in the catalogue",
}


@blind.command()
@_trial_argument
@click.option(
    "--left-out",
    type=_key_type(),
    metavar="KEY",
    help="Second round, once the first is sealed: each case without its true effect in the "
    "catalogue. The key tells which; no process that diagnoses sees it.",
)
@_jobs_option
@flags.json
def solve(directory: Path, left_out: Path | None, jobs: int) -> None:
    """Diagnose all cases of a trial, and seal the answers with their SHA-256.

    Each case is diagnosed in a process that can open nothing but the cases, so not the key. Each
    answer is written as it comes: when stopped, the same command goes on.

    \b
    Example: shm gap blind solve trial
    """
    from shm.blind.solving import solve_left_out, solve_trial

    trial = read_trial(directory)
    if left_out is None:
        with _told("solving") as told:
            solved = solve_trial(trial, jobs=jobs, told=told)
        seal = trial.seal("answers")
    else:
        from shm.blind.sealing import key_of

        truths, _ = key_of(trial, left_out)
        without = {each.case: each.left_out for each in truths if each.left_out}
        with _told("solving without the true effect") as told:
            solved = solve_left_out(trial, without, jobs=jobs, told=told)
        seal = trial.seal("left_out")
    if flags.wants_json():
        show(_solved_document(solved, seal))
        return
    _say_solved(solved, seal)


def _solved_document(solved: SolvedRound, seal: Path) -> dict[str, object]:
    failed = [{"case": each.case, "why": each.failure} for each in solved.failed]
    return {
        "answers": len(solved.answers),
        "earlier": solved.earlier,
        "failed": failed,
        "seal": str(seal),
        "sha256": solved.sha256,
    }


def _say_solved(solved: SolvedRound, seal: Path) -> None:
    count = len(solved.answers)
    known = f", {solved.earlier} of them earlier" if solved.earlier else ""
    click.echo(f"{count} cases are answered{known}; {len(solved.failed)} without a diagnosis.")
    if solved.unexpected:
        click.echo(
            f"Mind: {len(solved.unexpected)} failed by a fault of shm; please report it:", err=True
        )
        for answer in solved.unexpected:
            click.echo(f"  {answer.case}: {answer.failure}", err=True)
    click.echo(f"Their SHA-256, sealed in {seal}: {solved.sha256}")


@blind.command()
@_trial_argument
@click.option(
    "--key", type=_key_type(), metavar="FILE", show_default="DIR.key.json", help="The trial's key."
)
@click.option(
    "--html", type=flags.NewFile(), metavar="FILE", help="Write a page with all figures here."
)
@click.option("--gate", is_flag=True, help="Exit code 6 where a mark is missed.")
@flags.json
def score(directory: Path, key: Path | None, html: Path | None, gate: bool) -> None:
    """Open the key and say how good the answers are, with intervals.

    Key and answers are verified first: whoever changed either after it was sealed is found out.
    The second round counts where `solve --left-out` sealed one; the gate asks for it. A mark that
    too few cases speak of is not judged: from some 500 cases on all are.

    \b
    Example: shm gap blind score trial --html trial.html --gate
    """
    from shm.blind.scoring import opened
    from shm.report.as_html import as_html
    from shm.report.as_text import as_text
    from shm.report.trial_report import trial_json, trial_paper

    found = opened(directory, key or key_beside(directory))
    if html is not None:
        html.write_text(as_html(trial_paper(found)), encoding="utf-8")
    answer(trial_json(found), as_text(trial_paper(found), readable_width()).rstrip())
    if gate:
        _refuse_missed(found)


def _refuse_missed(found: TrialScore) -> None:
    judged = [mark for mark in found.marks if mark.met is not None]
    missed = [mark for mark in judged if not mark.met]
    if not found.left_out:
        raise GateNotMet(
            "the second round, without the true effects, was not run.",
            remedy="Run it first: shm gap blind solve DIR --left-out KEY.",
        )
    if missed:
        raise GateNotMet(
            f"{len(missed)} of {len(judged)} marks are missed.",
            remedy="The table says which; --html shows the cases.",
        )


@contextmanager
def _told(what: str) -> Iterator[Told]:
    """A bar on stderr that counts cases."""
    with counting_bar() as bar:
        task = bar.add_task(what, total=None)

        def tell(done: int, of: int) -> None:
            bar.update(task, completed=done, total=of)

        yield tell
