"""`shm validate`: our figures beside the thesis's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import rich_click as click

from shm.bridge import load_hanger
from shm.errors import GateNotMet, UsageError
from shm.values import Hanger
from shm_cli import flags, thesis
from shm_cli.common import progress_bar, show, show_rows
from shm_cli.validation import (
    formulas,
    frequencies,
    selection,
    solid_figures,
    thesis_figures,
    thesis_tables,
)
from shm_cli.validation.thesis_figures import Figure

FIGURES: dict[str, Callable[[Hanger, Callable[[str, float], None], str], Figure]] = {
    **dict.fromkeys(thesis_figures.SOLUTIONS, thesis_figures.solution),
    **solid_figures.FIGURES,
    **dict.fromkeys(thesis_figures.POSTERIORS, thesis_figures.posterior),
    **dict.fromkeys(thesis_figures.MODE_SHAPES, thesis_figures.mode_shape),
}
"""How each figure of the thesis is made, by its number."""

TABLES = tuple(sorted((*frequencies.TABLES, *thesis_tables.TABLES)))


@click.command()
@click.option(
    "--figure",
    type=click.Choice(tuple(FIGURES)),
    help="One figure of the thesis alone, ours; with --out as a picture.",
)
@click.option(
    "--table",
    "wanted",
    type=click.Choice(TABLES),
    help="One table of the thesis alone.",
)
@click.option(
    "--formulas",
    "practice",
    is_flag=True,
    help="Formulas of practice beside our answer, on beams of known tension.",
)
@click.option(
    "--list", "listed", is_flag=True, help="Every item of the thesis, and where it is shown."
)
@click.option(
    "--out",
    type=flags.NewFile(".png"),
    metavar="FILE.png",
    help="Draw the --figure here.",
)
@flags.seed
@flags.json
def command(
    figure: str | None,
    wanted: str | None,
    practice: bool,
    listed: bool,
    out: Path | None,
    seed: int,
) -> None:
    """Our figures beside the thesis's, with a gate.

    The thesis's tables of computed frequencies, then hanger 3: all five model classes on both
    printings of its measured table, once and counted ten times. Exit code 6 where a table is off
    by more than its mark, or the evidence does not prefer springs to fixed ends.

    \b
    Example: shm validate
    Example: shm validate --figure 2.4 --out figure_2_4.png
    Example: shm validate --table A.5
    Example: shm validate --formulas
    """
    given = {"--figure": figure, "--table": wanted, "--formulas": practice, "--list": listed}
    asked = [option for option, value in given.items() if value]
    if len(asked) > 1:
        raise UsageError(f"{' and '.join(asked)} are not one question.", remedy="Give one of them.")
    if figure is not None:
        _show_figure(figure, out)
        return
    if out is not None:
        raise UsageError("--out draws one figure.", remedy="Say which: --figure 2.4, say.")
    if listed:
        _show_list()
        return
    if practice:
        _show_formulas(seed)
        return
    if wanted is not None:
        _show_table(wanted, seed)
        return
    tables, chosen = compared(seed)
    parts = {
        "computed frequencies of the thesis": (
            frequencies.HEADS,
            [*map(frequencies.cells, tables)],
        ),
        "hanger 3 of the thesis": (selection.HEADS, [*map(selection.cells, chosen)]),
    }
    if flags.wants_json():
        show(
            {
                "frequencies": [asdict(row) for row in tables],
                "selection": [asdict(row) for row in chosen],
            }
        )
    else:
        for title, (heads, rows) in parts.items():
            show_rows(title, heads, rows)
    misses = [*frequencies.misses(tables), *selection.misses(chosen)]
    if misses:
        message = "; ".join(misses)
        raise GateNotMet(f"{message}.", remedy="See docs/trials/validation.md for the marks.")


def compared(
    seed: int,
) -> tuple[list[frequencies.FrequencyRow], list[selection.SelectionRow]]:
    """All rows of both parts."""
    hanger = load_hanger(thesis.HANGER_FILE)
    with progress_bar("validating") as progress:
        tables = frequencies.compared(hanger, progress)
        return tables, selection.compared(hanger, seed, progress)


def _show_figure(number: str, out: Path | None) -> None:
    with progress_bar("validating") as progress:
        found = FIGURES[number](load_hanger(thesis.HANGER_FILE), progress, number)
    if out is not None:
        found.write(out)
    if flags.wants_json():
        show(found.document)
    else:
        show_rows(found.title, found.heads, found.cells)
        click.echo(found.statement)
    if found.missed:
        raise GateNotMet(found.missed, remedy="Report this: the beam's solver is at fault.")


def _show_table(wanted: str, seed: int) -> None:
    if wanted in thesis_tables.TABLES:
        with progress_bar("validating") as progress:
            hanger = load_hanger(thesis.HANGER_FILE)
            shown = thesis_tables.TABLES[wanted](hanger, seed, progress)
        if flags.wants_json():
            show(shown.document)
        else:
            show_rows(f"table {wanted} of the thesis", shown.heads, shown.cells)
        return
    with progress_bar("validating") as progress:
        rows = frequencies.compared(load_hanger(thesis.HANGER_FILE), progress, wanted)
    if flags.wants_json():
        show([asdict(row) for row in rows])
    else:
        timed = any(row.thesis_time for row in rows)
        heads = frequencies.TIMED_HEADS if timed else frequencies.HEADS
        cells = map(frequencies.timed_cells if timed else frequencies.cells, rows)
        show_rows(f"table {wanted} of the thesis", heads, cells)
    misses = frequencies.misses(rows)
    if misses:
        message = "; ".join(misses)
        raise GateNotMet(f"{message}.", remedy="See docs/trials/validation.md for the marks.")


def _show_formulas(seed: int) -> None:
    with progress_bar("validating") as progress:
        rows = formulas.compared(load_hanger(thesis.HANGER_FILE), seed, progress)
    if flags.wants_json():
        show([asdict(row) for row in rows])
        return
    show_rows("formulas of practice", formulas.FORMULA_HEADS, formulas.formula_cells())
    show_rows("error of the tension", formulas.HEADS, map(formulas.cells, rows))


def _show_list() -> None:
    files = {"MODES.json": thesis.PRINTINGS["table 1.1"], "H.toml": thesis.HANGER_FILE}
    items = thesis.checklist()
    if flags.wants_json():
        show(items)
    else:
        heads = ("of", "what", "where")
        show_rows("the thesis", heads, [tuple(item[head] for head in heads) for item in items])
        for name, path in files.items():
            click.echo(f"{name}: {path}")
