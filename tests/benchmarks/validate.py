"""The tables of the thesis next to ours, with a gate; formulas of practice and its sampler.

    python tests/benchmarks/validate.py                    # what `make validate` runs: minutes
    python tests/benchmarks/validate.py --table A.5
    python tests/benchmarks/validate.py --formulas
    python tests/benchmarks/validate.py --update --sigma plane
    python tests/benchmarks/validate.py --update --textbook --repeat 10

Without an option: the thesis's tables of computed frequencies, then hanger 3, all five model
classes on both printings of its measured table, once and counted ten times. Exit code 6 where a
table differs by more than its mark, or the evidence does not prefer springs to fixed ends.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from shm.bridge import load_hanger
from shm.documents import dump, posterior_document
from shm.errors import GateNotMet, ShmError
from shm.inference import UpdateOptions, update
from shm.models import THESIS, build
from shm.resources import one_thread_a_process
from shm_cli.common import progress_bar, show_rows
from shm_cli.example import HANGER_FILE, MODES_FILE
from tests.benchmarks.thesis import (
    formulas,
    frequencies,
    selection,
    thesis_data,
    thesis_tables,
)
from tests.benchmarks.thesis.grouped_likelihood import update_grouped
from tests.benchmarks.thesis.textbook_tmcmc import update_textbook

TABLES = tuple(sorted((*frequencies.TABLES, *thesis_tables.TABLES)))

MARKS = "See docs/trials/validation.md for the marks."


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    question = parser.add_mutually_exclusive_group()
    question.add_argument("--table", choices=TABLES, help="one table of the thesis")
    question.add_argument(
        "--formulas", action="store_true", help="formulas of practice on beams of known tension"
    )
    question.add_argument(
        "--update", action="store_true", help="classes on table 1.1, with the options below"
    )
    question.add_argument(
        "--list", action="store_true", help="every item of the thesis, and where it is shown"
    )
    parser.add_argument("--classes", default="beam1,beam2", help="of --update")
    parser.add_argument("--repeat", type=int, default=1, help="how often the data count (N_D)")
    parser.add_argument("--samples", type=int, default=1000, help="posterior samples of --update")
    way = parser.add_mutually_exclusive_group()
    way.add_argument(
        "--sigma", metavar="plane|order|mode|1-3,4-6", help="a model error of each of these"
    )
    way.add_argument(
        "--textbook", action="store_true", help="the thesis's sampler; its evidence is biased"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="one JSON document")
    given = parser.parse_args(arguments)
    if (given.sigma or given.textbook or given.repeat != 1) and not given.update:
        parser.error("--sigma, --textbook and --repeat are options of --update")
    if given.repeat < 1 or given.samples < 1:
        parser.error("--repeat and --samples are at least 1")
    return given


def print_json(document: object) -> None:
    """Print a document on stdout: no verb of `shm` runs, whose schema it could have."""
    print(dump(document))


def show_table(wanted: str, seed: int, as_json: bool) -> None:
    hanger = load_hanger(HANGER_FILE)
    title = f"table {wanted} of the thesis"
    if wanted in thesis_tables.TABLES:
        with progress_bar() as progress:
            shown = thesis_tables.TABLES[wanted](hanger, seed, progress)
        if as_json:
            print_json(shown.document)
        else:
            show_rows(title, shown.heads, shown.cells)
        return
    with progress_bar() as progress:
        rows = frequencies.compared(hanger, progress, wanted)
    if as_json:
        print_json([asdict(row) for row in rows])
    else:
        timed = any(row.thesis_time for row in rows)
        heads = frequencies.TIMED_HEADS if timed else frequencies.HEADS
        cells = frequencies.timed_cells if timed else frequencies.cells
        show_rows(title, heads, map(cells, rows))
    refuse(frequencies.misses(rows))


def show_formulas(seed: int, as_json: bool) -> None:
    with progress_bar() as progress:
        rows = formulas.compared(load_hanger(HANGER_FILE), seed, progress)
    if as_json:
        print_json([asdict(row) for row in rows])
        return
    show_rows("formulas of practice", formulas.FORMULA_HEADS, formulas.formula_cells())
    show_rows("error of the tension", formulas.HEADS, map(formulas.cells, rows))


def show_list(as_json: bool) -> None:
    items = thesis_data.checklist()
    if as_json:
        print_json(items)
        return
    heads = ("of", "what", "where")
    show_rows("the thesis", heads, [tuple(item[head] for head in heads) for item in items])
    print(f"MODES.json: {MODES_FILE}")
    print(f"H.toml: {HANGER_FILE}")


def show_update(given: argparse.Namespace) -> None:
    """Show posterior and evidence of each class on table 1.1, by the way that was asked for."""
    hanger = load_hanger(HANGER_FILE)
    tests = thesis_data.measured_tests("table 1.1", given.repeat)
    options = UpdateOptions(samples=given.samples, seed=given.seed)
    documents: list[dict[str, Any]] = []
    errors: list[tuple[str, ...]] = []
    with progress_bar() as progress:
        for name in given.classes.split(","):
            model = build(name, hanger, THESIS)
            if given.sigma:
                posterior, groups = update_grouped(tests, model, given.sigma, options, progress)
            else:
                way = update_textbook if given.textbook else update
                posterior, groups = way(tests, model, options, progress), {}
            document = posterior_document(posterior)
            if groups:
                document["sigma_by_group"] = {key: asdict(each) for key, each in groups.items()}
            documents.append(document)
            errors += [
                (name, group, *(f"{value:.2%}" for value in (each.mean, each.q05, each.q95)))
                for group, each in groups.items()
            ]
    if given.json:
        print_json({"models": documents})
        return
    heads = ("class", "log evidence", "tension (kN)", "90 % interval (kN)", "effective draws")
    rows = [
        (
            each["model"],
            f"{each['log_evidence']:.2f} ± {each['log_evidence_sd']:.2f}",
            f"{each['tension_n']['mean'] / 1e3:.0f}",
            f"{each['tension_n']['q05'] / 1e3:.0f} to {each['tension_n']['q95'] / 1e3:.0f}",
            f"{each['effective_sample_size']:.0f}",
        )
        for each in documents
    ]
    show_rows(f"hanger 3, table 1.1, N_D = {given.repeat}", heads, rows)
    if errors:
        heads = ("class", "group", "mean", "5 %", "95 %")
        show_rows("model error of each group of modes", heads, errors)


def compared(
    seed: int,
) -> tuple[list[frequencies.FrequencyRow], list[selection.SelectionRow]]:
    """Return all rows of both parts."""
    hanger = load_hanger(HANGER_FILE)
    with progress_bar() as progress:
        tables = frequencies.compared(hanger, progress)
        return tables, selection.compared(hanger, seed, progress)


def show_all(seed: int, as_json: bool) -> None:
    tables, chosen = compared(seed)
    if as_json:
        print_json(
            {
                "frequencies": [asdict(row) for row in tables],
                "selection": [asdict(row) for row in chosen],
            }
        )
    else:
        title = "computed frequencies of the thesis"
        show_rows(title, frequencies.HEADS, map(frequencies.cells, tables))
        show_rows("hanger 3 of the thesis", selection.HEADS, map(selection.cells, chosen))
    refuse([*frequencies.misses(tables), *selection.misses(chosen)])


def refuse(misses: Sequence[str]) -> None:
    """Raise GateNotMet where a mark is missed."""
    if misses:
        raise GateNotMet(f"{'; '.join(misses)}.", remedy=MARKS)


def main(arguments: Sequence[str] | None = None) -> int:
    """Answer one question; return the exit code."""
    given = parse(arguments)
    try:
        if given.table:
            show_table(given.table, given.seed, given.json)
        elif given.formulas:
            show_formulas(given.seed, given.json)
        elif given.update:
            show_update(given)
        elif given.list:
            show_list(given.json)
        else:
            show_all(given.seed, given.json)
    except ShmError as error:
        print(f"Error: {error}", file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    one_thread_a_process()
    sys.exit(main())
