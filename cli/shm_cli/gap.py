"""`shm gap`: why model and measurement differ, and what that does to the tension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import rich_click as click

from shm.errors import NothingThere, UsageError
from shm.gap import GapOptions
from shm.gap import diagnose as diagnosed
from shm.models.effects import EFFECTS
from shm.pipeline import utc_now
from shm.pipeline.lineage import diagnosis_lineage
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.contents import DiagnosisSheet
from shm.report.diagnosis_report import diagnosis_json, diagnosis_paper
from shm.report.effect_file import effect_file
from shm.report.figures.every_figure import diagnosis_figures
from shm.values import Diagnosis, Hanger, ModalTest
from shm_cli import completion
from shm_cli.adopt import adopt, adopted, drop
from shm_cli.blind import blind
from shm_cli.common import (
    advancing_bar,
    drawing,
    figures_option,
    hanger_file_option,
    hanger_option,
    json_option,
    one_hanger,
    opened_store,
    readable_width,
    seed_option,
    show,
    tests_and_hanger,
    told_doubts,
)
from shm_cli.effects import effects
from shm_cli.parameter_types import NewFile
from shm_cli.update import modes_argument

_DEFAULT = GapOptions()


@click.group()
def command() -> None:
    """Why model and measurement differ, and what that does to tension.

    \b
    Example: shm gap diagnose hanger3.modes.json
    """


@command.command()
@modes_argument
@hanger_option()
@hanger_file_option
@click.option(
    "--baseline",
    metavar="NAME",
    default=_DEFAULT.baseline,
    show_default=True,
    shell_complete=completion.models,
    help="The model class whose gap is diagnosed.",
)
@click.option(
    "--without",
    multiple=True,
    metavar="EFFECT",
    shell_complete=completion.effects,
    help="Take an effect out of the catalogue; may be given again.",
)
@click.option(
    "--hold-out",
    multiple=True,
    metavar="TEST|ORDER",
    show_default="every order and every test in turn",
    help="Leave a test or an order of modes out of the fit and predict it; may be given again.",
)
@click.option(
    "--tests",
    "count",
    type=click.IntRange(1, 100),
    default=20,
    show_default=True,
    metavar="N",
    help="How many of the latest tests of a hanger of the workspace.",
)
@seed_option
@click.option(
    "--html",
    type=NewFile(),
    metavar="FILE",
    help="Write a page with all figures here.",
)
@click.option(
    "--write-effect",
    type=NewFile(),
    metavar="FILE.py",
    help="Write the law of something unknown here, as the module of a new effect.",
)
@figures_option
@json_option
@click.pass_context
def diagnose(
    ctx: click.Context,
    modes_file: Path | None,
    hanger_id: int | None,
    hanger_file: Path | None,
    baseline: str,
    without: tuple[str, ...],
    hold_out: tuple[str, ...],
    count: int,
    seed: int,
    html: Path | None,
    write_effect: Path | None,
    figures: Path | None,
    as_json: bool,
) -> None:
    """Where the gap lies, which effect causes it, how far it shrinks, what would tell.

    Of MODES.json with --hanger-file, or of the latest tests of a hanger of the workspace, which
    keeps the diagnosis for its report and for `shm gap adopt`. The answer gives every effect of
    the catalogue its probability, also no gap at all and something that the catalogue lacks.

    \b
    Example: shm gap diagnose hanger3.modes.json --hanger-file H.toml --html gap.html
    """
    options = GapOptions(baseline, without, hold_out, seed=seed)
    effect = _effect_name(write_effect) if write_effect is not None else ""
    if modes_file is None:
        sheet = _of_workspace(ctx, one_hanger(ctx, hanger_file, hanger_id), count, options)
    else:
        tests, hanger = tests_and_hanger(ctx, modes_file, hanger_file, hanger_id)
        told_doubts(tests, hanger)
        sheet = DiagnosisSheet(_diagnosis(tests, hanger, options), hanger)
    if html is not None or figures is not None:
        with drawing():
            _write(sheet, html, figures)
    if as_json:
        show(diagnosis_json(sheet))
    else:
        click.echo(as_text(diagnosis_paper(sheet), readable_width()).rstrip())
    if write_effect is not None:
        text = effect_file(sheet.diagnosis, sheet.hanger, effect)
        write_effect.write_text(text, encoding="utf-8")


command.add_command(adopt)
command.add_command(adopted)
command.add_command(drop)
command.add_command(blind)
command.add_command(effects)


def _of_workspace(
    ctx: click.Context, hanger: Hanger, count: int, options: GapOptions
) -> DiagnosisSheet:
    """The diagnosis of the latest tests, which the store keeps."""
    with opened_store(ctx) as (workspace, store):
        stored = store.tests.list_all(hanger.id)[-count:]
        if not stored:
            raise NothingThere(
                f"no test of hanger {hanger.id} is stored.", remedy="Take one in with `shm ingest`."
            )
        found = _diagnosis([each.test for each in stored], hanger, options)
        store.posteriors.save_diagnosis(
            hanger.id, found, diagnosis_lineage(stored, hanger, asdict(options)), utc_now()
        )
    return DiagnosisSheet(found, hanger, workspace.bridge.name)


def _diagnosis(tests: Sequence[ModalTest], hanger: Hanger, options: GapOptions) -> Diagnosis:
    with advancing_bar() as progress:
        return diagnosed(tests, hanger, options, progress)


def _effect_name(file: Path) -> str:
    """The name of the effect that a file holds, which the catalogue must not have yet."""
    name = file.stem.lower()
    if not name.isidentifier() or name in EFFECTS:
        raise UsageError(
            f"{file.name} names no new effect: the part before .py is its name.",
            remedy="Take letters, digits and underscores, such as play_of_guide.py.",
        )
    return name


def _write(sheet: DiagnosisSheet, html: Path | None, figures: Path | None) -> None:
    if html is not None:
        html.write_text(as_html(diagnosis_paper(sheet)), encoding="utf-8")
    if figures is not None:
        figures.mkdir(parents=True, exist_ok=True)
        for illustration in diagnosis_figures(sheet):
            (figures / f"{illustration.name}.png").write_bytes(illustration.png())
