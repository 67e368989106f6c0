"""`shm drift`: how far tension and end stiffness have moved from their baseline, and setting it.

`shm drift rebaseline`: a hanger is compared with itself as it is since some day.

`shm drift bridge`: which hangers gained and lost tension, and what explains it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import rich_click as click

from shm.errors import NothingThere
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import stored_pattern
from shm.report.shifts import pattern_json, pattern_tables, shift_cells
from shm.store import Baseline, BaselineGlance
from shm.store.posteriors import list_baselines_in_force
from shm.store.watch import find_latest_watches
from shm.values import Drift, Hanger
from shm.watch.repair_check import EVENT_KINDS
from shm_cli import flags
from shm_cli.common import opened_store, paragraph, progress_bar, show, show_rows, show_texts


@click.group(invoke_without_command=True)
@flags.hanger()
@click.option("--all", "all_tests", is_flag=True, help="All tests, not each hanger's latest.")
@flags.json
@click.pass_context
def command(ctx: click.Context, hanger_id: int | None, all_tests: bool) -> None:
    """Show how far tension and stiffness have moved.

    The shift of the latest test of each hanger from its baseline, if there is one at all: the
    tension in percent, an end stiffness as how many times what it was, with the probability that it
    lies beyond the threshold. With --hanger also how each quantity goes with the temperature. In
    JSON shifts are fractions of the tension and decades (powers of ten) of a stiffness.

    \b
    Example: shm drift --hanger 3 --all
    """
    if ctx.invoked_subcommand is not None:
        return
    states: StatesOverTime | None = None
    rebaselined: list[BaselineGlance] = []
    with opened_store() as (workspace, store):
        hangers: Sequence[Hanger] = workspace.bridge.hangers
        if hanger_id is not None:
            from shm.pipeline.reporting import hanger_states  # it loads the engine

            hangers = [workspace.bridge.hanger(hanger_id)]
            states = hanger_states(workspace, store, hangers[0], store.watch.baseline(hanger_id))
        if all_tests:
            shown: Sequence[Drift] = store.watch.list_drifts(hanger_id)
        else:
            latest = find_latest_watches(store, hangers)
            watched = [latest[each.id].watched for each in hangers if each.id in latest]
            shown = [drift for each in watched for drift in each.published_drifts]
            rebaselined = _without_a_test(store, hangers, {each.hanger for each in shown})
    if not shown and not rebaselined:
        raise NothingThere(
            "no test has been compared with a baseline yet.",
            remedy="Take in more tests: the first ones of a hanger form its baseline.",
        )
    if flags.wants_json():
        document: dict[str, object] = {"drifts": [asdict(drift) for drift in shown]}
        if states is not None:
            from shm.report.hanger_tables import temperature_documents

            document["temperature_coefficients"] = temperature_documents(states)
        show(document)
        return
    if shown:
        _show(shown)
    for each in rebaselined:
        sentence = (
            f"Hanger {each.hanger} has a new baseline ({each.since:%Y-%m-%d}); no test has come in "
            "since it was set."
        )
        click.echo(paragraph(sentence))
    if states is not None and states.temperature_coefficients:
        from shm.report.hanger_tables import temperature_table

        click.echo()
        show_texts(temperature_table(states))


@command.command("bridge")
@flags.json
@click.option(
    "--figure",
    type=flags.NewFile(".png"),
    metavar="FILE.png",
    help="Write the elevation of the bridge, hangers coloured by their shift, as a picture.",
)
def bridge(figure: Path | None) -> None:
    """Show which hangers gained and lost tension, and if the complete bridge moved.

    Compares the latest tension shift of each hanger with its neighbours': one hanger whose
    load moved to others, one that gained load, all alike (a temperature or a clock), or each
    without the others. Hangers stand
    along the bridge as in bridge.toml; tests more than 30 days older than the newest are left out.
    `shm report --bridge --out bridge.html` shows the same with the elevation of the bridge.

    \b
    Example: shm drift bridge
    """
    with opened_store() as (workspace, store):
        pattern = stored_pattern(store, [hanger.id for hanger in workspace.bridge.hangers])
    if figure is not None:
        from shm.report.figures.along_the_bridge import bridge_illustration

        figure.write_bytes(bridge_illustration(pattern).png())
        click.echo(f"Wrote {figure}.", err=True)
    if flags.wants_json():
        show(pattern_json(pattern))
        return
    for each in pattern_tables(pattern):
        show_texts(each)
    for sentence in (pattern.sentence, *pattern.remarks):
        click.echo(paragraph(sentence))


@command.command()
@flags.hanger(required=True)
@click.option(
    "--since",
    type=flags.Time(),
    required=True,
    metavar="DAY",
    help="The first day (UTC) whose tests count, such as 2026-05-01.",
)
@click.option(
    "--kind",
    type=click.Choice(list(EVENT_KINDS)),
    help="What was done: ends only the alerts that this explains.",
)
@flags.why
@flags.who
@flags.json
def rebaseline(
    hanger_id: int,
    since: datetime,
    kind: str | None,
    why: str,
    who: str,
) -> None:
    """Set a new baseline from the tests since a day.

    Use it after works on the hanger, or once a shift is examined and accepted. The tests since
    that day are updated jointly in the class of the hanger, and later tests are compared with them.
    Comparisons with the old baseline and their alerts stay on record.

    With --kind only the alerts end that such an event explains: a lamp ends those of an added mass,
    but not those of lost tension. A repair or retensioning must be visible in these tests, else the
    command is refused; for a loss that is to stay use "accepted as it is".

    \b
    Example: shm drift rebaseline --hanger 3 --since 2026-05-01 --why "pin replaced"
    Example: shm drift rebaseline --hanger 7 --since 2026-05-03 --kind retensioned --why "to 640 kN"
    """
    from shm.pipeline.rebaselining import Order, set_baseline  # it loads the engine

    event = EVENT_KINDS[kind] if kind else None
    order = Order(since, why, who, event)
    with opened_store() as (workspace, store):
        hanger = workspace.bridge.hanger(hanger_id)
        with progress_bar() as progress:
            found = set_baseline(workspace, store, hanger, order, utc_now(), progress)
    if flags.wants_json():
        of_event = {"kind": kind, "alerts_explained": found.explained, "alerts_open": found.left}
        show(
            {
                **_document(found.made),
                **of_event,
                "changes_within": [each.began_by for each in found.within],
                "accepted": [vars(each) for each in found.accepted],
            }
        )
        return
    if found.warning:
        click.echo(paragraph(found.warning), err=True)
    for sentence in found.sentences:
        click.echo(paragraph(sentence))


def _document(made: Baseline) -> dict[str, object]:
    tension = made.posterior.tension_n
    return {
        "id": made.id,
        "hanger": made.hanger,
        "since": made.since,
        "set_at": made.set_at,
        "who": made.who,
        "why": made.why,
        "model": made.posterior.model,
        "tests": list(made.posterior.tests),
        "tension_n": {"mean": float(tension.mean()), "sd": float(tension.std(ddof=1))},
    }


if TYPE_CHECKING:
    from shm.report.states import StatesOverTime
    from shm.store import Store


def _without_a_test(
    store: Store, hangers: Sequence[Hanger], compared: Collection[int]
) -> list[BaselineGlance]:
    """Return baselines set by a person with which no test has been compared yet."""
    others = [each for each in hangers if each.id not in compared]
    baselines = list_baselines_in_force(store, others) if others else {}
    return [each for each in baselines.values() if each.since]


def _show(drifts: Sequence[Drift]) -> None:
    headings = (
        "hanger", "test of", "quantity", "shift", "90 % interval", "threshold",
        "probability beyond",
    )  # fmt: skip
    rows = [(str(each.hanger), f"{each.time:%Y-%m-%d}", *shift_cells(each)) for each in drifts]
    show_rows("shift from the baseline, if there is one", headings, rows)
