"""The comparison with other samplers says what its runs say, and plans what it is asked for."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"


def loaded(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"peers_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


table = loaded(BENCHMARKS / "peers" / "table.py")
command = loaded(BENCHMARKS / "peers.py")
problem = loaded(BENCHMARKS / "peers" / "problem.py")

FIVE = (0.0, 0.1, -0.1, 0.05, -0.05)


def row(peer: str, seed: int, seconds: float, off: float) -> dict[str, Any]:
    sigma = "integrated" if peer == "shm" else "sampled"
    head = {"peer": peer, "problem": "thesis", "repeat": 1, "sigma": sigma, "seed": seed}
    exact = table.EVIDENCE["thesis", 1]
    evidence = {"version": "1", "log_evidence": exact + off, "log_evidence_sd": None}
    cost = {"cpu_seconds": seconds, "evaluations": 1000, "effective_samples": 100.0}
    return head | evidence | cost | {"theta_f": 1.2, "theta_f_sd": 0.1}


def rows(peer: str, seconds: float, offs: tuple[float, ...]) -> list[dict[str, Any]]:
    return [row(peer, seed, seconds, off) for seed, off in enumerate(offs, start=1)]


OURS = rows("shm", 1.0, FIVE)


@pytest.mark.parametrize(
    ("offs", "verdict"),
    [
        (FIVE, "right"),
        ((-1.0, -1.1, -0.9, -1.0, -1.0), "wrong"),
        ((-0.8, 0.8, 0.0, 0.0, 0.0), "wrong"),
        ((0.0, 0.1, -0.1, 0.05), "open: 4 of 5 runs"),
    ],
)
def test_an_evidence_is_right_after_five_runs_of_small_bias_and_spread(
    offs: tuple[float, ...], verdict: str
) -> None:
    (summary,) = table.summarised(rows("dynesty", 50.0, offs))
    assert summary.verdict == verdict


def test_the_bounds_hold_where_a_right_peer_is_dear_and_a_cheap_one_wrong() -> None:
    dear, cheap = rows("dynesty", 50.0, FIVE), rows("emcee", 2.0, (-3.0, -2.9))
    assert table.failed_bounds([*OURS, *dear, *cheap]) == []


def test_a_right_and_cheap_peer_breaks_a_bound() -> None:
    (failed,) = table.failed_bounds([*OURS, *rows("dynesty", 20.0, FIVE)])
    assert "only 20 times ours" in failed


def test_our_wrong_evidence_breaks_a_bound() -> None:
    (failed,) = table.failed_bounds(rows("shm", 1.0, (0.5, 0.6)))
    assert "bias +0.55" in failed


def test_every_sampler_has_a_script_a_title_and_pinned_versions() -> None:
    assert command.ENVIRONMENTS.keys() == table.TITLES.keys()
    for peer, environment in command.ENVIRONMENTS.items():
        assert (BENCHMARKS / "peers" / f"run_{peer}.py").is_file()
        pinned = BENCHMARKS / "peers" / "requirements" / f"{environment}.txt"
        lines = pinned.read_text().splitlines() if environment else []
        assert all("==" in line for line in lines)


def test_the_kept_runs_are_of_the_problems_as_they_are() -> None:
    kept = [row for row in command.kept(command.RUNS) if "failure" not in row]
    cases = {(row["problem"], row["repeat"], row["sigma"]) for row in kept}
    for case in cases:
        now = problem.Target(*case).fingerprint()
        found = {row["fingerprint"] for row in kept if row.items() >= dict_of(case).items()}
        assert found == {now}, f"{case}: run it anew, the problem has changed"


def dict_of(case: tuple[str, int, str]) -> dict[str, Any]:
    return dict(zip(("problem", "repeat", "sigma"), case, strict=True))
