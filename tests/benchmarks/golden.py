"""What people and programs see, kept beside what they saw before: for changes that only move code.

    python tests/benchmarks/golden.py --write /tmp/before      # on the commit before
    python tests/benchmarks/golden.py --against /tmp/before    # on the one after

JSON documents, texts, pages, what figures say in words, answers of a sealed trial and the schema,
on one bridge whose tests are simulated from fixed seeds. Without a folder they are made twice and
compared: the same seed must give the same answer. Times of the clock, seconds taken, paths,
checksums of these and numbers of processes are left out. Numbers in JSON may differ by 1e-9 of
themselves, words not.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from difflib import unified_diff
from itertools import islice
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

import numpy as np  # noqa: E402
import sqlalchemy as sa  # noqa: E402

from shm.documents import dump  # noqa: E402
from shm.modes_document import modes_document  # noqa: E402
from shm.simulate import HangerState  # noqa: E402
from shm.store import Workspace  # noqa: E402
from shm_cli.main import run  # noqa: E402
from tests.helpers.web_servers import served  # noqa: E402
from tests.helpers.workspaces import make_workspace, write_test  # noqa: E402
from tests.worlds.simulated.campaign import CampaignPlan, campaign  # noqa: E402

NEARLY = 1e-9
SETTINGS = {"models": "beam1,beam2", "samples": 400}
_LINES = 20
_BYTES_OF_PICTURES = re.compile(r"base64,[A-Za-z0-9+/=]+|<svg.*?</svg>", re.S)
_LEFT_OUT = (
    (re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d+)?)?(Z|\+00:00)?"), "<time>"),
    (re.compile(r"process \d+"), "process <number>"),
    (re.compile(r"\b[0-9.]+ ?(s|ms|GB)\b"), "<so much>"),
    (re.compile(r"[0-9]+ (B|kB|MB)\b"), "<size>"),
    (re.compile(r"\b[0-9a-f]{16,64}\b"), "<checksum>"),
)
_OF_THE_CLOCK = {"seconds", "evaluations_per_s", "disk_free_bytes", "duration_s"}


def commands(files: Path) -> dict[str, tuple[object, ...]]:
    """What is asked of the bridge, by the name of the answer; all of it once as JSON, too."""
    modes, hanger = files / "campaign.modes.json", files / "H.toml"
    (recording,) = (files / "simulated").glob("*.csv")
    return {
        "status": ("status",),
        "status-of": ("status", "--of", "t1"),
        "held": ("ingest", "--held"),
        "peek": ("ingest", "--peek", recording),
        "identify": ("identify", recording, "--hanger-file", hanger),
        "predict": (
            "predict", "beam1", "--set", "theta_F=0.9", "--set", "theta_L=1.01",
            "--hanger-file", hanger,
        ),
        "update": ("update", modes, "--hanger-file", hanger, "--model", "beam2"),
        "update-thesis": (
            "update", modes, "--hanger-file", hanger, "--model", "beam1", "--priors", "thesis",
        ),
        "select": ("select", modes, "--hanger-file", hanger),
        "diagnosis": ("gap", "diagnose", modes, "--hanger-file", hanger, "--baseline", "beam1"),
        "report": ("report", "--hanger", 3),
        "report-bridge": ("report", "--bridge"),
        "drift": ("drift", "--hanger", 3),
        "alerts": ("alerts",),
        "check": ("db", "check"),
    }  # fmt: skip


def answers(folder: Path) -> Iterator[tuple[str, str]]:
    """Name and content of everything that is compared."""
    workspace = make_workspace(folder / "bridge", hangers=(3, 4), settings=SETTINGS)
    hanger = folder / "H.toml"
    bridge = (folder / "bridge" / "bridge.toml").read_text()
    hanger.write_text(re.search(r"\[\[hanger\]\].*?(?=\n\[|\Z)", bridge, re.S)[0])  # type: ignore[index]
    simulated = ("simulate", "--hanger-file", hanger, "--seed", 7)
    _said(*simulated, "--out", folder / "simulated", "--first", "2026-04-01")
    described = workspace.bridge.hanger(3)
    state, rng = HangerState(described.nominal_tension_n), np.random.default_rng(7)
    tests = campaign(described, state, (), CampaignPlan(), rng)
    (folder / "campaign.modes.json").write_text(dump(modes_document(tests)) + "\n")
    for number, tension in enumerate((1.0, 0.8, 0.8)):
        write_test(workspace.spool / f"t{number}.modes.json", workspace, day=30.0 * number,
                   tension=tension)  # fmt: skip
        _said("--workspace", workspace.folder, "ingest", workspace.spool / f"t{number}.modes.json")
    for name, words in commands(folder).items():
        place = ("--workspace", workspace.folder)
        yield f"{name}.txt", _said(*place, *words)
        yield f"{name}.json", _said(*place, *words, "--json")
    out = folder / "report.html"
    _said("--workspace", workspace.folder, "report", "--hanger", 3, "--out", out)
    yield "report.html", _BYTES_OF_PICTURES.sub("<picture>", out.read_text())
    yield from _pages(workspace)
    yield "schema.txt", _schema(workspace)


def _pages(workspace: Workspace) -> Iterator[tuple[str, str]]:
    with served(workspace) as interface, interface.client(interface.read_token) as client:
        for path in (
            "/", "/hangers/3", "/hangers/3/tests", "/hangers/3/tests/t1", "/hangers/3/trend",
            "/alerts", "/operation", "/api/hangers", "/api/hangers/3", "/api/alerts",
            "/openapi.json",
        ):  # fmt: skip
            answer = client.get(path)
            name = f"page{path.replace('/', '-').removesuffix('.json')}"
            kind = "json" if "json" in answer.headers.get("content-type", "") else "html"
            yield f"{name}.{kind}", answer.text


def _schema(workspace: Workspace) -> str:
    engine = sa.create_engine(f"sqlite:///{workspace.database}")
    query = sa.text("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL ORDER BY name")
    with engine.connect() as connection:
        lines = [line for sql in connection.scalars(query) for line in sql.splitlines()]
    # A table that was made anew has its keys in another order each time.
    return "\n".join(sorted(line.strip().removesuffix(",") for line in lines))


def _said(*words: object) -> str:
    """What a command writes for its reader; one that fails ends it all: its answer says nothing."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run([str(word) for word in words])
    if code:
        raise RuntimeError(f"{' '.join(map(str, words))}: exit {code}: {err.getvalue()[-300:]}")
    return out.getvalue()


def cleaned(name: str, text: str, folder: Path) -> str:
    """Without what changes from one time to the next."""
    text = text.replace(str(folder), "<folder>")
    if name.endswith(".json"):
        with contextlib.suppress(json.JSONDecodeError):
            text = json.dumps(_without_clock(json.loads(text)), indent=1, sort_keys=True)
    for what, instead in _LEFT_OUT:
        text = what.sub(instead, text)
    return text


def _without_clock(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _without_clock(v) for k, v in value.items() if k not in _OF_THE_CLOCK}
    return [_without_clock(each) for each in value] if isinstance(value, list) else value


def made(folder: Path) -> dict[str, str]:
    """Every answer, by its name."""
    with tempfile.TemporaryDirectory() as work:
        found = {
            name: cleaned(name, text, Path(work)) for name, text in answers(Path(work).resolve())
        }
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in found.items():
        (folder / name).write_text(text)
    print(f"{len(found)} answers in {folder}")
    return found


def same(before: str, after: str) -> bool:
    """Whether two answers are alike but for the last digits of numbers in JSON."""
    if before == after:
        return True
    try:
        return _alike(json.loads(before), json.loads(after))
    except json.JSONDecodeError:
        return False


def _alike(one: Any, other: Any) -> bool:
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_alike(one[key], other[key]) for key in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_alike, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return bool(np.isclose(one, other, rtol=NEARLY, atol=0, equal_nan=True))
    return bool(one == other)


def differences(before: Path, after: dict[str, str]) -> int:
    """Prints what is not as it was; how many answers that are."""
    known = {path.name: path.read_text() for path in sorted(before.iterdir())}
    count = 0
    for name in sorted(known.keys() | after.keys()):
        if same(known.get(name, ""), after.get(name, "")):
            continue
        count += 1
        lines = unified_diff(
            known.get(name, "").splitlines(), after.get(name, "").splitlines(), lineterm="", n=0
        )
        print(f"== {name}", *(line[:160] for line in islice(lines, 2, _LINES)), sep="\n")
    print(f"{count} of {len(known.keys() | after.keys())} answers differ")
    return count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", type=Path)
    parser.add_argument("--against", type=Path)
    asked = parser.parse_args()
    if asked.write:
        made(asked.write)
        return
    with tempfile.TemporaryDirectory() as folder:
        before = asked.against or Path(folder) / "first"
        if asked.against is None:
            made(before)
        raise SystemExit(differences(before, made(Path(folder) / "now")) > 0)


if __name__ == "__main__":
    main()
