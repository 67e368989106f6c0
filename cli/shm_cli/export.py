"""`shm export`: posterior samples for other programs."""

from __future__ import annotations

from pathlib import Path

import rich_click as click

from shm import export
from shm.errors import BadInput
from shm.values import Hanger, ModalTest, Posterior
from shm_cli import flags
from shm_cli.common import opened_store, show, waiting


@click.command()
@flags.hanger(required=True)
@click.option("--test", metavar="ID", help="A test; the latest if left out.")
@click.option(
    "--format",
    "form",
    type=click.Choice(export.FORMATS),
    show_default="the suffix of FILE",
    help="Table of samples (csv, npz), the document of `shm update` with its draws (json), or what "
    "ArviZ and xarray read (netcdf, needs shm[export]).",
)
@click.option(
    "--out",
    required=True,
    type=flags.NewFile(),
    metavar="FILE.csv|.nc|.json|.npz",
    help="Where to write.",
)
@flags.json
def command(
    hanger_id: int,
    test: str | None,
    form: str | None,
    out: Path,
) -> None:
    """Export posterior samples for other programs.

    `shm report` states the tension over all classes, with a wider interval. One column a
    parameter, then tension_n and log_likelihood; equally weighted rows. NetCDF adds the measured
    frequencies and the likelihood of each, with units.

    \b
    Example: shm export --hanger 3 --out hanger3.csv
    """
    export.check_format(out, form)
    with opened_store() as (workspace, store):
        hanger = workspace.bridge.hanger(hanger_id)
        posterior = store.posteriors.get(hanger_id, test)
        tests = [store.tests.named(hanger_id, name).test for name in posterior.tests]
    with waiting("writing the samples"):
        _write(posterior, out, form, tests, hanger)
    if flags.wants_json():
        show({"file": str(out), "model": posterior.model, "samples": len(posterior.samples)})
        return
    click.echo(f"Wrote {len(posterior.samples)} samples of {posterior.model} to {out}.", err=True)


def _write(
    posterior: Posterior, out: Path, form: str | None, tests: list[ModalTest], hanger: Hanger
) -> None:
    """Write a posterior, with the likelihood of each measurement where available."""
    try:
        export.write(posterior, out, form, tests=tests, hanger=hanger)
    except BadInput as changed:
        click.echo(f"Without the likelihood of each measurement: {changed}", err=True)
        export.write(posterior, out, form)
