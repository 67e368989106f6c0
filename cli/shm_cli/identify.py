"""`shm identify`: modal parameters of recordings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import rich_click as click

from shm.documents import dump, modes_document
from shm.errors import BadInput, UsageError
from shm.identify import Identification, IdentifyOptions, identify
from shm.read import read
from shm.settings import Settings
from shm.values import Hanger
from shm_cli.common import (
    hanger_file_option,
    hanger_option,
    json_option,
    one_hanger,
    show,
    show_table,
    table,
)

_BAND = Settings()


@click.command()
@click.argument(
    "files",
    nargs=-1,
    required=True,
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE...",
)
@click.option("--together", is_flag=True, help="The files are hits of one test.")
@click.option(
    "--band",
    nargs=2,
    type=float,
    default=(_BAND.band_low_hz, _BAND.band_high_hz),
    show_default=True,
    metavar="LOW HIGH",
    help="Where to look for modes, in Hz.",
)
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="T.modes.json",
    help="Write the modal-tests document here.",
)
@hanger_option()
@hanger_file_option
@json_option
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[Path, ...],
    together: bool,
    band: tuple[float, float],
    out: Path | None,
    hanger_id: int | None,
    hanger_file: Path | None,
    as_json: bool,
) -> None:
    """Modal parameters of recordings.

    Each file is a test of its own unless --together is given. The hanger's length, where known,
    helps to number the modes.

    \b
    Example: shm identify hanger3.csv --hanger-file H.toml --out hanger3.modes.json
    """
    known = hanger_file is not None or hanger_id is not None
    hanger = one_hanger(ctx, hanger_file, hanger_id) if known else None
    options = IdentifyOptions(band_low_hz=band[0], band_high_hz=band[1])
    groups = [files] if together else [(path,) for path in files]
    found = [_identify(group, hanger, options) for group in groups]
    _refuse_several_hangers(found)
    document = modes_document([each.test for each in found])
    if out is not None:
        out.write_text(dump(document) + "\n", encoding="utf-8")
    if as_json:
        show(document)
    else:
        for each in found:
            _show(each)


def _identify(
    group: Sequence[Path], hanger: Hanger | None, options: IdentifyOptions
) -> Identification:
    """One test; it is of the described hanger where its records do not say."""
    records = [read(path) for path in group]
    found = identify(records, options, test_id=group[0].stem, hanger=hanger)
    named = found.test.hanger
    if hanger is None or named == hanger.id:
        return found
    if named is not None:
        raise BadInput(
            f"the file says hanger {named}, the description is of hanger {hanger.id}.",
            file=group[0],
            remedy="Give the description of its hanger, or correct the file.",
        )
    return replace(found, test=replace(found.test, hanger=hanger.id))


def _refuse_several_hangers(found: Sequence[Identification]) -> None:
    named = {each.test.hanger for each in found}
    if len(named) > 1:
        listed = ", ".join(sorted("none" if n is None else str(n) for n in named))
        raise UsageError(
            f"the files are of several hangers ({listed}); a document holds one.",
            remedy="Identify the files of each hanger by themselves.",
        )


def _show(found: Identification) -> None:
    made = table(
        f"{found.test.id}: {len(found.test.modes)} modes from "
        f"{sum(hit.used for hit in found.hits)} hits",
        "mode", "frequency (Hz)", "sd (Hz)", "damping (%)", "sd (%)",
    )  # fmt: skip
    for mode in found.test.modes:
        made.add_row(
            f"{mode.plane} {mode.order}",
            f"{mode.frequency_hz:.4f}",
            _known(mode.frequency_sd_hz, 1, ".5f"),
            _known(mode.damping_ratio, 100, ".3f"),
            _known(mode.damping_sd, 100, ".3f"),
        )
    show_table(made)
    for note in found.notes:
        click.echo(note, err=True)
    for dropped in found.dropped:
        click.echo(f"left out: {dropped.count} {dropped.what}: {dropped.reason}", err=True)


def _known(value: float, factor: float, spec: str) -> str:
    return format(value * factor, spec) if math.isfinite(value) else "unknown"
