"""`shm gap`: why model and measurement differ, and what that does to the tension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeAlias

import rich_click as click

from shm.errors import NothingThere, UsageError
from shm.gap import GapOptions, diagnose_bridge
from shm.gap import diagnose as diagnosed
from shm.gap.shared_causes import LEAST
from shm.models.effects import EFFECTS
from shm.pipeline import utc_now
from shm.pipeline.lineage import diagnosis_lineage
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.bridge_diagnosis_report import bridge_diagnosis_json, bridge_diagnosis_paper
from shm.report.contents import BridgeDiagnosisSheet, DiagnosisSheet
from shm.report.diagnosis_remainder import effect_file
from shm.report.diagnosis_report import diagnosis_json, diagnosis_paper
from shm.report.figures.every_figure import bridge_diagnosis_figures, diagnosis_figures
from shm.report.figures.specification import Illustration
from shm.report.paper import Paper
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
    latest_tests,
    one_hanger,
    opened_store,
    readable_width,
    seed_option,
    show,
    tests_and_hanger,
    told_doubts,
)
from shm_cli.effects import effects
from shm_cli.gap_plan import plan
from shm_cli.parameter_types import NewFile

_DEFAULT = GapOptions()


@click.group()
def command() -> None:
    """Why model and measurement differ, and what that does to tension.

    \b
    Example: shm gap diagnose hanger3.modes.json
    """


@command.command()
@click.argument(
    "files",
    metavar="[MODES.json] [H.toml MODES.json H.toml ...]",
    nargs=-1,
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
)
@hanger_option()
@hanger_file_option
@click.option("--bridge", is_flag=True, help="All hangers of the workspace together.")
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
    files: tuple[Path, ...],
    hanger_id: int | None,
    hanger_file: Path | None,
    bridge: bool,
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

    With --bridge, or of several MODES.json, each followed by its H.toml: whether hangers share a
    cause, which of them have it, and what it does to their tensions.

    \b
    Example: shm gap diagnose hanger3.modes.json --hanger-file H.toml --html gap.html
    Example: shm gap diagnose h1.modes.json h1.toml h2.modes.json h2.toml
    Example: shm --workspace arch gap diagnose --bridge --html bridge.html
    """
    options = GapOptions(baseline, without, hold_out, seed=seed)
    effect = _effect_name(write_effect) if write_effect is not None else ""
    shown: _Shown
    if bridge or len(files) > 1:
        if effect:
            raise UsageError(
                "--write-effect writes what one hanger leaves open.", remedy="Diagnose it alone."
            )
        shown = _OfBridge(_jointly(ctx, files, bridge, (hanger_id, hanger_file), count, options))
    elif not files:
        hanger = one_hanger(ctx, hanger_file, hanger_id)
        shown = _OfHanger(_of_workspace(ctx, hanger, count, options))
    else:
        tests, hanger = tests_and_hanger(ctx, files[0], hanger_file, hanger_id)
        shown = _OfHanger(DiagnosisSheet(_diagnosis(tests, hanger, options), hanger))
    if html is not None or figures is not None:
        with drawing():
            _write(shown, html, figures)
    if as_json:
        show(shown.document())
    else:
        click.echo(as_text(shown.paper(), readable_width()).rstrip())
    if write_effect is not None and isinstance(shown, _OfHanger):
        text = effect_file(shown.sheet.diagnosis, shown.sheet.hanger, effect)
        write_effect.write_text(text, encoding="utf-8")


command.add_command(adopt)
command.add_command(adopted)
command.add_command(drop)
command.add_command(blind)
command.add_command(effects)
command.add_command(plan)


def _of_workspace(
    ctx: click.Context, hanger: Hanger, count: int, options: GapOptions
) -> DiagnosisSheet:
    """The diagnosis of the latest tests, which the store keeps."""
    with opened_store(ctx) as (workspace, store):
        stored = latest_tests(store, hanger, count)
        found = _diagnosis([each.test for each in stored], hanger, options)
        store.posteriors.save_diagnosis(
            hanger.id, found, diagnosis_lineage(stored, hanger, asdict(options)), utc_now()
        )
    return DiagnosisSheet(found, hanger, workspace.bridge.name)


def _diagnosis(tests: Sequence[ModalTest], hanger: Hanger, options: GapOptions) -> Diagnosis:
    with advancing_bar() as progress:
        return diagnosed(tests, hanger, options, progress)


def _jointly(
    ctx: click.Context,
    files: tuple[Path, ...],
    bridge: bool,
    one: tuple[int | None, Path | None],
    count: int,
    options: GapOptions,
) -> BridgeDiagnosisSheet:
    """Several hangers together: of files, or all of the workspace, which keeps each one's own."""
    if (bridge and files) or any(each is not None for each in one):
        raise UsageError(
            "--bridge takes all hangers of the workspace, several files name theirs.",
            remedy="Give MODES.json H.toml pairs alone, or --bridge alone.",
        )
    if bridge:
        return _of_bridge(ctx, count, options)
    found = [tests_and_hanger(ctx, modes, of, None) for modes, of in _pairs(files)]
    for tests, hanger in found:
        told_doubts(tests, hanger)
    with advancing_bar() as progress:
        named = [(hanger, tests) for tests, hanger in found]
        return BridgeDiagnosisSheet(diagnose_bridge(named, options, progress))


def _pairs(files: tuple[Path, ...]) -> list[tuple[Path, Path]]:
    pairs = list(zip(files[::2], files[1::2], strict=False))
    if len(files) % 2 or any(hanger.suffix != ".toml" for _, hanger in pairs):
        raise UsageError(
            "several MODES.json are given, but not each with its description.",
            remedy="Write each H.toml right behind its MODES.json.",
        )
    return pairs


def _of_bridge(ctx: click.Context, count: int, options: GapOptions) -> BridgeDiagnosisSheet:
    """All hangers of the workspace that have tests and that the baseline can describe."""
    with opened_store(ctx) as (workspace, store):
        stored = {
            hanger: tests
            for hanger in workspace.bridge.hangers
            if hanger.is_modelled and (tests := store.tests.list_all(hanger.id)[-count:])
        }
        if len(stored) < LEAST:
            raise NothingThere(
                f"{len(stored)} of {len(workspace.bridge.hangers)} hangers have a test, a shared "
                f"cause takes {LEAST}.",
                remedy="Take tests in with `shm ingest`.",
            )
        with advancing_bar() as progress:
            named = [(hanger, [e.test for e in tests]) for hanger, tests in stored.items()]
            found = diagnose_bridge(named, options, progress)
        for (hanger, tests), own in zip(stored.items(), found.diagnoses, strict=True):
            lineage = diagnosis_lineage(tests, hanger, asdict(options))
            store.posteriors.save_diagnosis(hanger.id, own, lineage, utc_now())
    return BridgeDiagnosisSheet(found, workspace.bridge.name)


@dataclass(frozen=True)
class _OfHanger:
    """The answer for one hanger, as it is shown."""

    sheet: DiagnosisSheet

    def document(self) -> dict[str, Any]:
        return diagnosis_json(self.sheet)

    def paper(self) -> Paper:
        return diagnosis_paper(self.sheet)

    def figures(self) -> Sequence[Illustration]:
        return diagnosis_figures(self.sheet)


@dataclass(frozen=True)
class _OfBridge:
    """The answer for several hangers, as it is shown."""

    sheet: BridgeDiagnosisSheet

    def document(self) -> dict[str, Any]:
        return bridge_diagnosis_json(self.sheet)

    def paper(self) -> Paper:
        return bridge_diagnosis_paper(self.sheet)

    def figures(self) -> Sequence[Illustration]:
        return bridge_diagnosis_figures(self.sheet.diagnosis)


_Shown: TypeAlias = _OfHanger | _OfBridge


def _effect_name(file: Path) -> str:
    """The name of the effect that a file holds, which the catalogue must not have yet."""
    name = file.stem.lower()
    if not name.isidentifier() or name in EFFECTS:
        raise UsageError(
            f"{file.name} names no new effect: the part before .py is its name.",
            remedy="Take letters, digits and underscores, such as play_of_guide.py.",
        )
    return name


def _write(shown: _Shown, html: Path | None, figures: Path | None) -> None:
    if html is not None:
        html.write_text(as_html(shown.paper()), encoding="utf-8")
    if figures is not None:
        figures.mkdir(parents=True, exist_ok=True)
        for illustration in shown.figures():
            (figures / f"{illustration.name}.png").write_bytes(illustration.png())
