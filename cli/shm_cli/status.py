"""`shm status`: what the workspace holds and what waits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import rich_click as click

from shm.models import applicable
from shm.pipeline.adopting import GapWatch, gap_watch
from shm.report.words import model_class
from shm.store import DeliveryState, Store, Workspace
from shm_cli.common import json_option, opened_store, show, show_table, table


@click.command()
@json_option
@click.pass_context
def command(ctx: click.Context, as_json: bool) -> None:
    """What the workspace holds and what waits.

    \b
    Example: shm --workspace arch status
    """
    with opened_store(ctx) as (workspace, store):
        document = _status(workspace, store)
    if as_json:
        show(document)
        return
    recordings = ", ".join(f"{n} {stage}" for stage, n in document["recordings"].items() if n)
    click.echo(f"{document['bridge']}: recordings: {recordings or 'none yet'}")
    click.echo(f"in the spool: {document['spool']}, in quarantine: {document['quarantine']}")
    click.echo(
        f"alerts: {document['alerts']}, deliveries waiting: {document['waiting_deliveries']}"
    )
    made = table("hangers", "hanger", "tests", "latest", "model class", "baseline since")
    for row in document["hangers"]:
        latest, since = row["latest_test"], row["baseline_set_at"]
        made.add_row(
            str(row["hanger"]),
            str(row["tests"]),
            f"{latest:%Y-%m-%d %H:%M}" if latest else "none",
            model_class(row["model"]) if row["model"] else "none yet",
            f"{since:%Y-%m-%d %H:%M}" if since else "none yet",
        )
    show_table(made)
    for said, hangers in _competitions(document["hangers"]).items():
        click.echo(f"hanger{'s' if ',' in hangers else ''} {hangers}: {said}")
    for row in document["hangers"]:
        if row["gap"] is not None:
            click.echo(f"hanger {row['hanger']}: {row['gap']['said']}")


def _gap(watch: GapWatch | None) -> dict[str, Any] | None:
    """How the gap has gone since an effect was adopted; None where none is."""
    if watch is None:
        return None
    return {
        "before_percent": watch.adopted.adoption.gap_before_percent,
        "adopted_percent": watch.adopted.adoption.gap_percent,
        "now_percent": watch.now_percent,
        "has_grown": watch.has_grown,
        "said": str(watch),
    }


def _competitions(rows: list[dict[str, Any]]) -> dict[str, str]:
    """Which classes compete and why others do not, each with the hangers that it is true of."""
    found: dict[str, list[str]] = {}
    for row in rows:
        said = f"{', '.join(map(model_class, row['competing'])) or 'no model class'} may compete"
        for reason, names in _by_reason(row["not_applicable"]).items():
            said += f"; {', '.join(names)} {'do' if names[1:] else 'does'} not apply: {reason}"
        found.setdefault(f"{said}.", []).append(str(row["hanger"]))
    return {said: ", ".join(hangers) for said, hangers in found.items()}


def _by_reason(not_applicable: Mapping[str, str]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for name, reason in not_applicable.items():
        found.setdefault(reason.removesuffix("."), []).append(name)
    return found


def _status(workspace: Workspace, store: Store) -> dict[str, Any]:
    models = store.selected_models()
    hangers = []
    for hanger in workspace.bridge.hangers:
        tests, baseline = store.tests(hanger.id), store.baseline(hanger.id)
        adopted = [each.adoption.model for each in store.adoptions(hanger.id)]
        names, reasons = applicable(hanger, [*workspace.settings.model_names, *adopted])
        hangers.append(
            {
                "hanger": hanger.id,
                "tests": len(tests),
                "latest_test": tests[-1].time if tests else None,
                "model": models.get(hanger.id),
                "competing": list(names),
                "not_applicable": reasons,
                "baseline_set_at": baseline.set_at if baseline else None,
                "gap": _gap(gap_watch(store, hanger.id)),
            }
        )
    quarantined = workspace.quarantine.folder.glob("*.reason.json")
    return {
        "bridge": workspace.bridge.name,
        "recordings": {stage.value: n for stage, n in store.stage_counts().items()},
        "spool": sum(path.is_file() for path in workspace.spool.rglob("*")),
        "quarantine": sum(1 for _ in quarantined),
        "alerts": len(store.alerts()),
        "waiting_deliveries": len(store.deliveries(DeliveryState.WAITING)),
        "hangers": hangers,
    }
