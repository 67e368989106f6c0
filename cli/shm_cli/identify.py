"""`shm identify`: modal parameters of recordings, with all that a person needs to check them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import rich_click as click

from shm.documents import dump
from shm.errors import BadInput, UsageError
from shm.identify import IDENTIFIERS, IdentifyOptions, identify
from shm.identify.each_hit import as_csv
from shm.identify.plausibility import signal_doubts
from shm.modes_document import modes_document
from shm.read.sandbox import peek_test, read_test
from shm.report.as_text import as_text
from shm.report.contents import ModalTestReport
from shm.report.modal_test_report import modal_test_paper
from shm.settings import Settings
from shm.values import FrequencyResponse, Hanger, Recording
from shm_cli import flags
from shm_cli.common import (
    answer,
    counting_bar,
    drawing,
    is_workspace,
    one_hanger,
    open_workspace,
    readable_width,
    show_doubts,
    write_pictures,
)

if TYPE_CHECKING:
    from shm.store import Workspace

_DEFAULT = Settings()


@click.command()
@click.argument("files", nargs=-1, required=True, type=flags.FILE, metavar="FILE...")
@click.option("--together", is_flag=True, help="The files are one test: hits, or set-ups.")
@click.option(
    "--band",
    nargs=2,
    type=float,
    default=(_DEFAULT.band_low_hz, _DEFAULT.band_high_hz),
    metavar="LOW HIGH",
    help="Where to look for modes, in Hz.",
)
@click.option(
    "--identifier",
    type=click.Choice(list(IDENTIFIERS)),
    default=_DEFAULT.identifier,
    help="How modes are found; pyoma2: by its own SSI and clustering.",
)
@click.option(
    "--cross-check",
    type=click.Choice([*IDENTIFIERS, "none", "auto"]),
    default=_DEFAULT.cross_check,
    help="A second identifier whose frequencies are compared; auto: of structures without a model.",
)
@click.option(
    "--estimator",
    type=click.Choice(["h1", "h2", "hv"]),
    default=_DEFAULT.estimator,
    help="Of the frequency response: noise in the responses, the force, or both.",
)
@click.option(
    "--reference-force",
    "reference_force_n",
    type=float,
    default=_DEFAULT.reference_force_n,
    metavar="N",
    help="A hit this hard, in N, has amplitude 1.",
)
@click.option(
    "--frequency-allowance",
    type=click.FloatRange(min=0, max=0.01),
    default=_DEFAULT.frequency_allowance,
    help="Part of a frequency that differs from test to test unseen.",
)
@click.option(
    "--mains",
    "mains_hz",
    type=float,
    default=_DEFAULT.mains_hz,
    metavar="HZ",
    help="Frequency of the power grid.",
)
@click.option(
    "--window",
    "window_time_constant_s",
    type=float,
    default=math.inf,
    show_default="none",
    metavar="SECONDS",
    help="Time constant of the exponential window already in given frequency responses.",
)
@click.option(
    "--out",
    type=flags.NewFile(),
    metavar="T.modes.json",
    help="Write the modal-tests document here.",
)
@click.option(
    "--html",
    type=flags.NewFile(),
    metavar="SHEET.html",
    help="Write a page with all figures here; one test only.",
)
@click.option(
    "--hits",
    type=flags.NewFile(),
    metavar="HITS.csv",
    help="Write each hit with its force, its modes, and why it is not used; one test only.",
)
@flags.figures
@flags.hanger()
@flags.hanger_file
@flags.json
def command(
    files: tuple[Path, ...],
    together: bool,
    band: tuple[float, float],
    out: Path | None,
    html: Path | None,
    hits: Path | None,
    figures: Path | None,
    hanger_id: int | None,
    hanger_file: Path | None,
    **chosen: Any,
) -> None:
    """Identify the modes of recordings.

    Each file is one test, unless --together is given; a .zip holds the files of one test. The
    description of the hanger helps to number the modes. In a workspace the answers stored for the
    file's logger are used. The page (--html) shows time histories, frequency responses with the
    fitted modes, stabilisation, shapes and quality.

    \b
    Example: shm identify hanger3.csv --hanger-file H.toml --html hanger3.html
    """
    known = hanger_file is not None or hanger_id is not None
    hanger = one_hanger(hanger_file, hanger_id) if known else None
    groups = [files] if together else [(path,) for path in files]
    if (html is not None or hits is not None) and len(groups) > 1:
        raise UsageError(
            f"{'--html' if html else '--hits'} shows one test.",
            remedy="Give one file, or --together.",
        )
    options = IdentifyOptions(band_low_hz=band[0], band_high_hz=band[1], **chosen)
    workspace = None
    if hanger_file is None and (hanger_id is not None or is_workspace()):
        workspace = open_workspace()
    with counting_bar() as bar:
        sheets = [
            _identified(group, hanger, options, workspace)
            for group in bar.track(groups, description="identifying")
        ]
    _refuse_several_hangers(sheets)
    with drawing():
        _write(sheets, out, html, figures)
    if hits is not None:
        found = sheets[0].identification
        hits.write_text(as_csv(found.each_hit, found.test.modes), encoding="utf-8")
    papers = [as_text(modal_test_paper(sheet), readable_width()).rstrip() for sheet in sheets]
    answer(_document(sheets), "\n".join(papers))


def _identified(
    group: Sequence[Path],
    hanger: Hanger | None,
    options: IdentifyOptions,
    workspace: Workspace | None,
) -> ModalTestReport:
    """Identify one test; it is of the described hanger where its records name none."""
    records = [record for path in group for record in _read(path, workspace)]
    for doubt in signal_doubts([r for r in records if isinstance(r, Recording)], hanger):
        click.echo(f"Doubtful: {doubt.text}", err=True)
    found = identify(records, options, test_id=group[0].stem, hanger=hanger)
    named = found.test.hanger
    if hanger is not None and named is None:
        found = replace(found, test=replace(found.test, hanger=hanger.id))
    elif hanger is not None and named != hanger.id:
        raise BadInput(
            f"the file says hanger {named}, the description is of hanger {hanger.id}.",
            file=group[0],
            remedy="Give the description of its hanger, or correct the file.",
        )
    if hanger is not None:
        show_doubts([found.test], hanger)
    return ModalTestReport(found, records, hanger)


def _read(path: Path, workspace: Workspace | None) -> tuple[Recording | FrequencyResponse, ...]:
    """Read a file as the workspace would, by the profile of its logger; say what is left out."""
    if workspace is None:
        return _records_of(path)
    from shm.pipeline.intake import as_taken_in

    with as_taken_in(path, workspace) as found:
        return _records_of(found)


def _records_of(path: Path) -> tuple[Recording | FrequencyResponse, ...]:
    records = read_test(path)
    if names := dict.fromkeys(name for look in peek_test(path) for name in look.left_out):
        click.echo(f"Left out of {path.name}: {', '.join(names)}.", err=True)
    return records


def _refuse_several_hangers(sheets: Sequence[ModalTestReport]) -> None:
    named = {sheet.identification.test.hanger for sheet in sheets}
    if len(named) > 1:
        listed = ", ".join(sorted("none" if n is None else str(n) for n in named))
        raise UsageError(
            f"the files are of several hangers ({listed}); a document holds one.",
            remedy="Identify the files of each hanger by themselves.",
        )


def _document(sheets: Sequence[ModalTestReport]) -> dict[str, Any]:
    """Return the modal-tests document, each test with its quality and what was set aside."""
    found = [sheet.identification for sheet in sheets]
    document = modes_document([each.test for each in found])
    for entry, each in zip(document["tests"], found, strict=True):
        entry["quality"] = [asdict(check) for check in each.quality]
        entry["set_aside"] = [asdict(mode) for mode in each.set_aside]
    return document


def _write(
    sheets: Sequence[ModalTestReport], out: Path | None, html: Path | None, figures: Path | None
) -> None:
    if out is not None:
        out.write_text(dump(_document(sheets)) + "\n", encoding="utf-8")
    # What draws is loaded where something is drawn: it takes a third of a second.
    if html is not None:
        from shm.report.as_html import as_html

        html.write_text(as_html(modal_test_paper(sheets[0])), encoding="utf-8")
    if figures is None:
        return
    from shm.report.modal_test_report import modal_test_figures

    for sheet in sheets:
        write_pictures(modal_test_figures(sheet), figures, f"{sheet.identification.test.id}-")
