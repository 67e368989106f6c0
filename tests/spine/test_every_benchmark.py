"""Each benchmark begins, takes the arguments that `make bench` gives it, and its end is judged."""

from __future__ import annotations

import csv
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import pytest

from tests.benchmarks import every
from tests.helpers.makefiles import make_targets

# The proof of docs/trials/validation.md names a command a row: by its first word.
PROOF: dict[str, list[str]] = defaultdict(list)
with (every.ROOT / "docs/trials/proof.csv").open(newline="", encoding="utf-8") as file:
    for row in csv.DictReader(file):
        command = row["command"].strip("`")
        PROOF[command.split()[0]].append(command)

# Each as `__main__`, in one process, so that what they all import is imported once.
BEGUN = """
import argparse, contextlib, io, runpy, shlex, sys, traceback
from pathlib import Path
from tests.benchmarks import every
from tests.helpers.makefiles import make_targets

class Parsed(Exception):
    pass

def parsed(parser, *given):
    parse(parser, *given)
    raise Parsed

parse, argparse.ArgumentParser.parse_args = argparse.ArgumentParser.parse_args, parsed
proof = [shlex.split(command) for command in sys.argv[1:]]
for name in every.benchmarks():
    rows = [row for short in (False, True) for row in every.commands(name, short, Path("none"))]
    rows += [row for row in proof if Path(row[1]).stem == name]
    for sys.argv in [each[1:] for each in rows] + [[rows[0][1], "--help"]]:
        sys.path[:0] = [str(every.HERE)]
        said = io.StringIO()
        try:
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                runpy.run_path(sys.argv[0], run_name="__main__")
            print(sys.argv, "takes no arguments")
        except Parsed:
            pass
        except SystemExit as ended:
            if ended.code != 0:
                print(sys.argv, said.getvalue())
        except Exception:
            print(sys.argv, traceback.format_exc())
        sys.path.remove(str(every.HERE))
"""


def test_every_benchmark_can_be_imported_and_takes_its_arguments() -> None:
    begun = subprocess.run(
        [sys.executable, "-c", BEGUN, *PROOF["python"]], cwd=every.ROOT, env=every.ENVIRONMENT,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert begun.stdout + begun.stderr == ""


@pytest.mark.parametrize(
    ("program", "verdict"),
    [
        ("pass", every.HELD),
        ("raise SystemExit('the mark is missed')", every.MISSED),
        ("1 / 0", every.BROKEN),
        ("raise SystemExit(6)", every.MISSED),
        ("raise SystemExit(2)", every.BROKEN),
        ("import time; time.sleep(60)", every.UNFINISHED),
    ],
)
def test_a_missed_mark_is_no_broken_benchmark(program: str, verdict: str, tmp_path: Path) -> None:
    seconds = 0.5 if verdict == every.UNFINISHED else 60.0
    assert every.run([[sys.executable, "-c", program]], tmp_path / "log.txt", seconds) == verdict


def test_every_command_of_the_proof_exists() -> None:
    """Scripts take their arguments by the test above."""
    assert set(PROOF) == {"make", "python"}
    at_root, here = make_targets(every.ROOT), make_targets(every.HERE)
    for command in PROOF["make"]:
        *options, target = command.split()[1:]
        assert options in ([], ["-C", "tests/benchmarks"]), command
        assert target in (here if options else at_root), command
    words = [command.split() for command in PROOF["python"]]
    assert all((every.ROOT / each[1]).is_file() for each in words)
    # Of several commands one after the other, `every.py --only NAME` is the one.
    named = {each[3] if "every.py" in each[1] else Path(each[1]).stem for each in words}
    assert named <= set(every.benchmarks())


def test_the_table_of_arguments_names_benchmarks_andmake_targets() -> None:
    assert set(every.WHOLE | every.SHORT) <= set(every.benchmarks())
    assert set(every.TESTS) <= make_targets(every.HERE)


def test_every_mechanism_that_an_ablation_leaves_out_is_there() -> None:
    """In a process of its own: its modules shut out threads and set the path."""
    program = """
import begin
from tests.benchmarks import gap_ablation, identify_ablation, inference_ablation, watch_ablation
from tests.benchmarks.left_out import without
steps = {name: changes for name, (changes, _) in identify_ablation.STEPS.items()}
for table in (gap_ablation.VARIANTS, identify_ablation.CONSTANTS, steps,
              inference_ablation.VARIANTS, watch_ablation.MECHANISMS):
    for changes in table.values():
        with without(changes):
            pass
"""
    subprocess.run([sys.executable, "-c", program], cwd=every.HERE, check=True)
