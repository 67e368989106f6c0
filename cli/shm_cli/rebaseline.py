"""`shm drift rebaseline`: a hanger is compared with itself as it is since some day."""

from __future__ import annotations

import getpass
from datetime import UTC, datetime

import rich_click as click

from shm.pipeline import utc_now
from shm.pipeline.rebaselining import Order
from shm.pipeline.rebaselining import rebaseline as rebaseline_in_store
from shm.store import Baseline
from shm.values.force_units import force_unit
from shm_cli.common import hanger_option, json_option, opened_store, progress_bar, show
from shm_cli.record import Words

_FORMATS = ["%Y-%m-%d", "%Y-%m-%dT%H:%M", "%Y-%m-%dT%H:%M:%SZ"]


@click.command()
@hanger_option(required=True)
@click.option(
    "--since",
    type=click.DateTime(_FORMATS),
    required=True,
    metavar="DAY",
    help="The first day (UTC) whose tests count, such as 2026-05-01.",
)
@click.option("--why", type=Words(), required=True, help="For the record.")
@click.option("--who", show_default="the user's name", help="For the record.")
@json_option
@click.pass_context
def rebaseline(
    ctx: click.Context, hanger_id: int, since: datetime, why: str, who: str | None, as_json: bool
) -> None:
    """Compare a hanger with itself as it is since some day.

    After works on it, or once a shift was looked into and accepted. The tests since that day are
    updated jointly in the hanger's class; that is its baseline, and tests taken in later are
    watched against it. What was compared with the old baseline stays on record, and so do its
    alerts.

    \b
    Example: shm drift rebaseline --hanger 3 --since 2026-05-01 --why "pin replaced"
    """
    order = Order(since.replace(tzinfo=UTC), why, who or getpass.getuser())
    with opened_store(ctx) as (workspace, store):
        hanger = workspace.bridge.hanger(hanger_id)
        with progress_bar("updating") as progress:
            made = rebaseline_in_store(workspace, store, hanger, order, utc_now(), progress)
        alerts = [each.id for each in store.alerts(hanger_id) if each.acknowledgement is None]
    if as_json:
        show(_document(made))
        return
    tension_n = made.posterior.tension_n
    unit = force_unit(float(tension_n.mean()))
    tension = unit.of(tension_n)
    count = len(made.posterior.tests)
    tests = "one test" if count == 1 else f"{count} tests"
    click.echo(
        f"Hanger {hanger_id} is compared with its {tests} since {since:%Y-%m-%d} from now on: "
        f"{tension.mean():.4g} {unit.name} (sd {tension.std(ddof=1):.2g} {unit.name})."
    )
    if alerts:
        numbers = ", ".join(str(each) for each in alerts)
        click.echo(f"Still open of it: alert {numbers}. Take note of them by `shm alerts ack ID`.")


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
