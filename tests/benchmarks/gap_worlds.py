"""Score the gap diagnosis on hangers whose causes are known (`tests/worlds/gapped_hangers.py`).

python tests/benchmarks/gap_worlds.py --hangers 43 --seed 7 --jobs 2 --out gap_worlds.json
python tests/benchmarks/gap_worlds.py --hangers 43 --seed 7 --out gap_worlds.json --without-cause
python tests/benchmarks/gap_worlds.py --hangers 43 --seed 7 --out gap_worlds.json --score

Every 43 hangers hold each of the 20 causes twice and three sound ones. Every hanger goes through
`shm.diagnose` as a user's would: its TOML, its modes, all options left alone. With
`--without-cause` each hanger with a cause of the catalogue is diagnosed once more without it. The
file holds every finished diagnosis; a second run goes on where the first one stopped. Ten to sixty
seconds of one core a diagnosis. A cause counts as given when it is in the leading explanation, be
it one effect or a pair; as in the group when it is in any explanation of the leading group.

The baseline is a plain clamped bar. By what a sound hanger is seen to differ from it (described
fittings, shear, sag of a described lean: `truth["inherent"]`) is true but not what was asked: an
answer that holds it and no planted cause is *inherent*, neither right nor wrong.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

# Processes of one thread each: more only wait for each other.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.stats import beta

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import shm  # noqa: E402
from tests.worlds.gapped_hangers import Case, make_case  # noqa: E402

Row = dict[str, Any]
MAX_CAUSES = 8
SURE = 0.8
STATED = 0.9


def load_case(case: Case) -> tuple[Any, Any]:
    """Return the hanger and its tests as a user gets them: through their files."""
    with tempfile.TemporaryDirectory() as folder:
        hanger_file, modes_file = case.write(Path(folder))
        return shm.load_hanger(hanger_file), shm.load_modes(modes_file)


def summarize_diagnosis(found: Any) -> Row:
    """Return what the scores need of a diagnosis."""
    leading = found.leading
    group = [leading] if leading is not None else []
    if leading is not None and leading.group is not None:
        group = [each for each in found.causes if each.group == leading.group]

    def interval(tension: Any) -> dict[str, float]:
        return {key: float(getattr(tension, key)) for key in ("mean", "sd", "q025", "q975")}

    return {
        "leads": found.leads,
        "leading": list(leading.effects) if leading is not None else [],
        "leading_at": leading.at if leading is not None else "",
        "claim": float(found.claim(leading)) if leading is not None else 0.0,
        "group": sorted({name for each in group for name in each.effects}),
        "no_gap": float(found.no_gap_probability),
        "unexplained": float(found.unexplained_probability),
        "causes": [
            [each.effect, each.at, float(each.probability), each.group]
            for each in found.causes[:MAX_CAUSES]
        ],
        "fit_p_value": float(found.fit_p_value),
        "before": interval(found.tension_before_n),
        "after": interval(found.tension_after_n),
        "remarks": list(found.remarks),
    }


def diagnose_case(seed: int, index: int, is_without: bool) -> Row:
    """Diagnose a case, with its causes in the catalogue or without them."""
    case = make_case(seed, index)
    accepted = sorted({name for each in case.truth["causes"] for name in each["accepted"]})
    row: Row = {"index": index, "without": is_without, "truth": case.truth, "accepted": accepted}
    if is_without and not accepted:
        return row | {"skipped": True}
    hanger, tests = load_case(case)
    started = time.process_time()
    try:
        found = shm.diagnose(tests, hanger, without=accepted if is_without else ())
    except shm.ShmError as error:
        return row | {"refused": str(error), "seconds": time.process_time() - started}
    return row | summarize_diagnosis(found) | {"seconds": time.process_time() - started}


def is_given(row: Row, names: Sequence[str]) -> bool:
    """Return True if the leading explanation holds one of the names."""
    return bool(set(row.get("leading", ())) & set(names))


def is_in_group(row: Row, names: Sequence[str]) -> bool:
    """Return True if the leading explanation or one of its group holds one of the names."""
    return bool(set(row.get("group", ())) & set(names))


def is_sure_and_wrong(row: Row) -> bool:
    """Return True if a group is claimed with more than `SURE` and holds nothing that is true."""
    return bool(row["claim"] > SURE and is_wrong(row))


def is_right(row: Row) -> bool:
    """Return True if the leading group holds a planted cause."""
    return not row["without"] and is_in_group(row, row["accepted"])


def is_inherent(row: Row) -> bool:
    """Return True if the leading group holds no planted cause, but an inherent difference."""
    return not is_right(row) and is_in_group(row, list(row["truth"]["inherent"]))


def is_wrong(row: Row) -> bool:
    """Return True if a cause leads and its group holds nothing that is true."""
    return bool(row["leads"] == "cause" and not is_right(row) and not is_inherent(row))


def format_share(rows: Sequence[Row], test: Callable[[Row], bool]) -> str:
    """Format a fraction of the rows with its 90 % interval (Clopper and Pearson)."""
    n, k = len(rows), sum(test(row) for row in rows)
    if not n:
        return "of no case"
    low = beta.ppf(0.05, k, n - k + 1) if k else 0.0
    high = beta.ppf(0.95, k + 1, n - k) if k < n else 1.0
    return f"{k} of {n}: {k / n:.2f} ({low:.2f} to {high:.2f})"


def _covers(row: Row) -> bool:
    after = row["after"]
    return bool(after["q025"] <= row["truth"]["tension_n"] <= after["q975"])


def _errors(rows: Sequence[Row], key: str) -> str:
    if not rows:
        return "of no case"
    off = [abs(row[key]["mean"] / row["truth"]["tension_n"] - 1) for row in rows]
    return f"{np.median(off):.2%} (worst {max(off):.1%})"


def score(rows: Sequence[Row]) -> str:
    """Return the table of scores of finished diagnoses, as Markdown."""
    refused = [row for row in rows if "refused" in row]
    done = [row for row in rows if "leads" in row]
    full = [row for row in done if not row["without"]]
    less = [row for row in done if row["without"]]
    sound = [row for row in full if not row["truth"]["causes"]]
    bare = [row for row in sound if not row["truth"]["inherent"]]
    single = [row for row in full if len(row["truth"]["causes"]) == 1]
    listed = [row for row in single if row["accepted"]]
    foreign = [row for row in single if not row["accepted"]]
    pairs = [row for row in full if len(row["truth"]["causes"]) == 2]
    stated = [row for row in full if row["claim"] >= STATED]

    def holds_all(row: Row) -> bool:
        return all(is_in_group(row, each["accepted"]) for each in row["truth"]["causes"])

    def is_unexplained(row: Row) -> bool:
        return bool(row["leads"] == "unexplained")

    def is_missed(row: Row) -> bool:
        return bool(row["leads"] == "no gap")

    lines = [
        ("refused", f"{len(refused)} of {len(rows)}"),
        ("sound: a gap claimed", format_share(sound, lambda row: not is_missed(row))),
        ("... where nothing inherent is seen", format_share(bare, lambda row: not is_missed(row))),
        ("sound: a false cause claimed", format_share(sound, is_wrong)),
        ("one cause: given first", format_share(listed, lambda r: is_given(r, r["accepted"]))),
        ("one cause: in leading group", format_share(listed, is_right)),
        ("one cause: inherent", format_share(listed, is_inherent)),
        ("one cause: wrong", format_share(listed, is_wrong)),
        ("one cause: no gap", format_share(listed, is_missed)),
        ("one cause: unexplained", format_share(listed, is_unexplained)),
        ("off the catalogue: a false cause claimed", format_share(foreign, is_wrong)),
        ("off the catalogue: unexplained", format_share(foreign, is_unexplained)),
        ("pair: one of both in leading group", format_share(pairs, is_right)),
        ("pair: both in leading group", format_share(pairs, holds_all)),
        (f"sure (> {SURE}) and wrong: all", format_share(full, is_sure_and_wrong)),
        ("... of sound", format_share(sound, is_sure_and_wrong)),
        ("... of one cause", format_share(listed, is_sure_and_wrong)),
        ("... of off the catalogue", format_share(foreign, is_sure_and_wrong)),
        ("... of cause left out", format_share(less, is_sure_and_wrong)),
        ("cause left out: a false cause claimed", format_share(less, is_wrong)),
        (f"stated with {STATED} or more: true", format_share(stated, lambda r: not is_wrong(r))),
        ("... planted", format_share(stated, is_right)),
        ("tension: 95 % interval holds", format_share(full, _covers)),
        ("... of sound", format_share(sound, _covers)),
        ("... of one cause", format_share(listed, _covers)),
        ("... of off the catalogue", format_share(foreign, _covers)),
        ("... of cause left out", format_share(less, _covers)),
        ("tension error before, median", _errors(full, "before")),
        ("tension error after, median", _errors(full, "after")),
    ]
    seconds = [row["seconds"] for row in done]
    if seconds:
        spent = f"{np.median(seconds):.1f} s, worst {max(seconds):.0f} s"
        lines.append(("processor time, median", spent))
    return "\n".join(["| score | value |", "|---|---|", *(f"| {a} | {b} |" for a, b in lines)])


def format_case(row: Row) -> str:
    """Format one diagnosis as a line."""
    truth = row["truth"]
    planted = " + ".join(
        f"{each['cause']} {each['size']:.3g} ({each['visible']:.0f} se)" for each in truth["causes"]
    )
    inherent = ", ".join(f"{name} {size:.0f} se" for name, size in truth["inherent"].items())
    head = f"{row['index']:3d} {'-' if row['without'] else ' '} {truth['kind']:6s} "
    head += f"xi {truth['xi']:5.1f}, {truth['tests']} tests, modes {truth['counts']}"
    head += f"{', shapes' if truth['shapes'] else ''}: {planted or 'sound'}"
    head += f" [inherent: {inherent}]" if inherent else ""
    if "refused" in row:
        return f"{head}\n        refused: {row['refused']}"
    named = " + ".join(row["leading"]) or row["leads"]
    if row["leading_at"]:
        named += f" ({row['leading_at']})"
    verdicts = {"right": is_right, "inherent": is_inherent, "wrong": is_wrong}
    verdict = next((name for name, test in verdicts.items() if test(row)), "none")
    off = [row[key]["mean"] / truth["tension_n"] - 1 for key in ("before", "after")]
    return (
        f"{head}\n        {verdict}: {named}, claim {row['claim']:.2f}, "
        f"no gap {row['no_gap']:.2f}, "
        f"unknown {row['unexplained']:.2f}; tension {off[0]:+.2%} -> {off[1]:+.2%}"
        f"{'' if _covers(row) else ' NOT COVERED'}; {row['seconds']:.0f} s\n"
        f"        group: {', '.join(row['group'])}"
    )


def _read(out: Path, seed: int) -> dict[tuple[int, bool], Row]:
    if not out.exists():
        return {}
    document = json.loads(out.read_text(encoding="utf-8"))
    if document["seed"] != seed:
        raise SystemExit(f"{out} is of seed {document['seed']}; name another file.")
    return {(row["index"], row["without"]): row for row in document["rows"]}


def _write(out: Path, seed: int, rows: dict[tuple[int, bool], Row]) -> None:
    beside = out.with_suffix(".part")
    document = {"seed": seed, "rows": [rows[key] for key in sorted(rows)]}
    beside.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    beside.replace(out)


def main() -> None:
    """Run what is lacking, then print all cases and the scores."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hangers", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--without-cause", action="store_true")
    parser.add_argument("--score", action="store_true", help="print what the file holds, no more")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "gap_worlds.json")
    asked = parser.parse_args()
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    rows = _read(asked.out, asked.seed)
    wanted = [(index, False) for index in range(asked.hangers)]
    if asked.without_cause:
        wanted += [(index, True) for index in range(asked.hangers)]
    lacking = [] if asked.score else [key for key in wanted if key not in rows]
    with ProcessPoolExecutor(asked.jobs) as pool:
        running = [pool.submit(diagnose_case, asked.seed, *key) for key in lacking]
        for future in as_completed(running):
            row = future.result()
            rows[row["index"], row["without"]] = row
            _write(asked.out, asked.seed, rows)
            if "skipped" not in row:
                print(format_case(row), flush=True)
    chosen = [rows[key] for key in wanted if key in rows and "skipped" not in rows[key]]
    print(f"\nSeed {asked.seed}, {asked.hangers} hangers, {len(chosen)} diagnoses.\n")
    print(score(chosen))


if __name__ == "__main__":
    main()
