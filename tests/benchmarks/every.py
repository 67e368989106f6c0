"""Every benchmark, each in a process of its own, and one table of how they ended.

    python tests/benchmarks/every.py                     # what `make bench` runs: a day or two
    python tests/benchmarks/every.py --short             # small cases and no other tests: an hour
    python tests/benchmarks/every.py --only evidence,week --anew

A benchmark is each file beside this one that can be run, but those that make environments of other
packages (`make -C tests/benchmarks bench-peers`). What it prints is kept in `build/bench/NAME.txt`,
and the table in `build/bench/table.md`; of the short form in `build/bench/short`. What held is not
run again as long as neither the files that git knows nor its arguments change, so an interrupted
run goes on. A mark is missed where the exit code is 1 or 6 and nothing was traced back; any other
fault is a broken benchmark, and makes the exit code 1. One without marks holds when it comes to its
end. With few cases, or on a busy machine, a mark is also missed by chance.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
KEPT = ROOT / "build" / "bench"
ELSEWHERE = ("every", "peers", "identify_peers")

# Arguments of the whole run and of the short one, where it has any. Commands of one are parted by
# semicolons; FOLDER is one of its own, not there at the first.
WHOLE = {
    "blind_trial": "FOLDER",
    "gap_dynamics": "--seed 300",
}
SHORT = {
    "alert_delivery": "--alerts 12 --kills 2",
    "any_simulator": "--cases 2",
    "blind_trial": "FOLDER --hangers 2 --left-out 1",
    "calibration": "--draws 20 --samples 300", "clock_faults": "1",
    "damage": "--minutes 0.5", "dashboard": "--hangers 4 --tests 10 --rounds 1 --warm-only",
    "durations": "--repeats 1",
    "evidence": "--seeds 2 --textbook-seeds 2", "full_disk": "--files 1 --every 40",
    "fuzz_readers": "--files 200 --flow 5 --processes 1", "gap_calibration": "--cases 1 --jobs 1",
    "gap_ablation": "--hangers 2 --only whole",
    "gap_dynamics": "--cases 1 --seed 300", "gap_family": "--families 1 --sound 0 --hangers 2",
    "identify_ablation": "--kinds softening --seeds 3:4",
    "identify_limits": "--sound 2 --faulty 1", "identify_seconds": "--runs 1",
    "identify_simulated": "--tests 4", "identify_sound": "--seeds 0:2",
    "kill_daemon": "--kills 4 --files 6",
    "kill_stream": "--kills 4",
    "kill_two_daemons": "--files 12",
    "kill_workers": "--kills 4 --files 6",
    "load": "--queue 4 --hangers 2 --alerts 1 --models beam2 --kinds modes",
    "mutants": "--mutants 1", "power_cuts": "--files 1 --minutes 0.3",
    "recordings_trial": "--kinds softening --seeds 0:1",
    "right_signals": "--tests 2", "sharp_evidence": "--cases 2", "solid_models": "--held-out 2",
    "stream_load": "--hangers 2 --hours 0.2",
    "stream_trial": "--hangers 1 --years 0.2", "stream_windows": "--seeds 1 --hours 0.3",
    "tension_coverage": "--cases 2",
    "validate": "--table A.6",
    "watch_ablation": "--only everything --world network --scenarios step5 --bridges 1",
    "round_bars": "--seeds 100:101", "wrong_diameter": "--hangers 1",
    "watch_worlds": "--world tied_arch --scenarios quiet --bridges 1 --years 1 --jobs 1",
    "week": "--tests 24 --hangers 2 --every 6 --samples 200", "worlds": "--hangers 1",
}  # fmt: skip
# Tests that `make bench` runs too, by targets of the Makefile here, which set their processor.
TESTS = {
    "test-slow": "The slow tests.",
    "test-trials": "The statistical trials among the tests.",
    "without-avx512": "The numerics as on a processor without AVX-512.",
    "without-avx2": "The numerics as on a processor without AVX2 and FMA.",
}
# One that hangs must not keep the others waiting. `kill_workers` gives up after four hours.
LONGEST_S, LONGEST_SHORT_S = 8 * 3600, 90
HELD, MISSED, BROKEN = "held", "missed a mark", "broken"
UNFINISHED = "not finished, no fault so far"
MISSED_CODES = (1, 6)  # of a script, and of GateNotMet
TRACED = "Traceback (most recent call last)"
# Benchmarks are run from a checkout, whichever one is installed.
ENVIRONMENT = os.environ | {
    "PYTHONPATH": os.pathsep.join(str(ROOT / folder) for folder in ("", "daemon", "cli")),
    "PYTHONUNBUFFERED": "1",
}


def benchmarks() -> dict[str, str]:
    """Each file that can be run, with the first line of its docstring."""
    found = {}
    for path in sorted(HERE.glob("*.py")):
        text = path.read_text(encoding="utf-8")
        if "\nif __name__" in text and path.stem not in ELSEWHERE:
            found[path.stem] = (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]
    return found


def commands(name: str, short: bool, folder: Path) -> list[list[str]]:
    if name in TESTS:
        return [["make", "--directory", str(HERE), name]]
    script = [sys.executable, str(HERE / f"{name}.py")]
    rows = (SHORT if short else WHOLE).get(name, "").split(";")
    return [script + row.replace("FOLDER", str(folder / name / "trial")).split() for row in rows]


def state() -> str:
    """The commit, and what was changed since in the files that git knows."""
    asked = (["git", "rev-parse", "HEAD"], ["git", "diff", "HEAD"])
    return "".join(
        subprocess.run(each, cwd=ROOT, check=True, capture_output=True, text=True).stdout
        for each in asked
    )


def run(asked: list[list[str]], log: Path, seconds: float) -> str:
    """Runs the commands of one benchmark, up to the first that fails; its verdict."""
    until = time.monotonic() + seconds
    with log.open("w", encoding="utf-8") as out:
        for command in asked:
            print("$", *command, file=out, flush=True)
            process = subprocess.Popen(
                command, cwd=ROOT, env=ENVIRONMENT, stdout=out, stderr=out, start_new_session=True
            )
            code = None
            try:
                with suppress(subprocess.TimeoutExpired):
                    code = process.wait(max(until - time.monotonic(), 0.0))
                traced = TRACED in log.read_text(encoding="utf-8", errors="replace")
            finally:
                end(process)
            if code != 0:
                broken = traced or code not in (None, *MISSED_CODES)
                return BROKEN if broken else UNFINISHED if code is None else MISSED
    return HELD


def end(process: subprocess.Popen[bytes]) -> None:
    """Interrupted, a benchmark ends its daemons and clears its folders; then goes what is left."""
    for sent, patience_s in ((signal.SIGINT, 20.0), (signal.SIGKILL, None)):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, sent)
        with suppress(subprocess.TimeoutExpired):
            process.wait(patience_s)


def processor_s() -> float:
    """Of all processes that were begun here and have been waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def write_table(about: dict[str, str], ended: dict[str, Any], folder: Path) -> None:
    lines = ["| benchmark | | verdict | processor s | log |", "|---|---|---|---|---|"]
    for name, said in about.items():
        if name in ended:
            each = ended[name]
            row = (name, said, each["verdict"], f"{each['processor_s']:.0f}", f"{name}.txt")
            lines.append("| " + " | ".join(row) + " |")
    (folder / "table.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--short", action="store_true", help="small cases, benchmarks alone")
    parser.add_argument("--only", help="names, parted by commas")
    parser.add_argument("--anew", action="store_true", help="also what held already")
    parser.add_argument("--longest", type=float, help="of each, in s; then it is ended")
    given = parser.parse_args()
    about = benchmarks() if given.short else TESTS | benchmarks()
    asked = given.only.split(",") if given.only else list(about)
    if unknown := set(asked) - set(about):
        parser.error(f"no such benchmark: {', '.join(sorted(unknown))}")
    folder = KEPT / "short" if given.short else KEPT
    folder.mkdir(parents=True, exist_ok=True)
    kept = folder / "ended.json"
    ended = json.loads(kept.read_text()) if kept.exists() else {}
    longest_s = given.longest or (LONGEST_SHORT_S if given.short else LONGEST_S)
    # Begun behind `&`, a process ignores an interrupt, and so do those that it begins.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    now = state()
    todo = {name: commands(name, given.short, folder) for name in about}
    of = {name: hashlib.sha256(f"{now}{todo[name]}".encode()).hexdigest() for name in about}
    ended = {name: row for name, row in ended.items() if row["of"] == of.get(name)}
    for number, name in enumerate(asked, start=1):
        if ended.get(name, {}).get("verdict") == HELD and not given.anew:
            print(f"[{number}/{len(asked)}] {name}: held before", flush=True)
            continue
        print(f"[{number}/{len(asked)}] {name} ...", end=" ", flush=True)
        shutil.rmtree(folder / name, ignore_errors=True)
        began, began_s = time.monotonic(), processor_s()
        said = run(todo[name], folder / f"{name}.txt", longest_s)
        ended[name] = {"verdict": said, "processor_s": processor_s() - began_s, "of": of[name]}
        print(f"{said}, {time.monotonic() - began:.0f} s", flush=True)
        kept.write_text(json.dumps(ended, indent=1))
        write_table(about, ended, folder)
    return int(any(ended[name]["verdict"] == BROKEN for name in asked))


if __name__ == "__main__":
    sys.exit(main())
