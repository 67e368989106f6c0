"""`shm export`: posterior samples for other programs."""

from __future__ import annotations

import csv
from pathlib import Path

import rich_click as click

from shm.errors import UsageError
from shm.store import samples_npz, samples_table
from shm.values import Posterior
from shm_cli.common import hanger_option, opened_store


@click.command()
@hanger_option(required=True)
@click.option("--test", metavar="ID", help="A test; the latest if left out.")
@click.option(
    "--out", required=True, type=click.Path(dir_okay=False, path_type=Path), metavar="FILE.csv|.npz"
)
@click.pass_context
def command(ctx: click.Context, hanger_id: int, test: str | None, out: Path) -> None:
    """Posterior samples for other programs.

    One column a parameter, then tension_n and log_likelihood; equally weighted rows.

    \b
    Example: shm export --hanger 3 --out hanger3.csv
    """
    if out.suffix not in _WRITERS:
        raise UsageError(f"{out.name}: unknown suffix.", remedy="Use .csv or .npz.")
    with opened_store(ctx) as (workspace, store):
        workspace.bridge.hanger(hanger_id)
        posterior = store.posterior(hanger_id, test)
    _WRITERS[out.suffix](posterior, out)
    click.echo(f"Wrote {len(posterior.samples)} samples of {posterior.model} to {out}.", err=True)


def _write_csv(posterior: Posterior, path: Path) -> None:
    names, rows = samples_table(posterior)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(rows.tolist())


def _write_npz(posterior: Posterior, path: Path) -> None:
    path.write_bytes(samples_npz(posterior))


_WRITERS = {".csv": _write_csv, ".npz": _write_npz}
