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


def row(peer: str, seed: int, seconds: float, off: float) -> dict[str, Any]:
    sigma = "integrated" if peer == "shm" else "sampled"
    head = {"peer": peer, "repeat": 1, "sigma": sigma, "seed": seed, "version": "1"}
    evidence = {"log_evidence": table.EVIDENCE[1] + off, "log_evidence_sd": None}
    cost = {"cpu_seconds": seconds, "evaluations": 1000, "effective_samples": 100.0}
    return head | evidence | cost | {"theta_f": 1.2, "theta_f_sd": 0.1}


def rows(peer: str, seconds: float, offs: tuple[float, ...]) -> list[dict[str, Any]]:
    return [row(peer, seed, seconds, off) for seed, off in enumerate(offs, start=1)]


OURS = rows("shm", 1.0, (0.05, -0.05, 0.0))


@pytest.mark.parametrize(
    ("offs", "verdict"),
    [
        ((0.1, -0.1, 0.0), "right"),
        ((-1.0, -1.1, -0.9), "wrong"),
        ((-0.8, 0.8, 0.0), "wrong"),
        ((0.0,), "one run"),
    ],
)
def test_an_evidence_is_right_where_bias_and_spread_are_small(
    offs: tuple[float, ...], verdict: str
) -> None:
    (summary,) = table.summarised(rows("dynesty", 50.0, offs))
    assert summary.verdict == verdict


def test_the_bounds_hold_where_a_right_peer_is_dear_and_a_cheap_one_wrong() -> None:
    dear, cheap = rows("dynesty", 50.0, (0.0, 0.1)), rows("blackjax", 2.0, (-3.0, -2.9))
    assert table.failed_bounds([*OURS, *dear, *cheap]) == []


def test_a_right_and_cheap_peer_breaks_a_bound() -> None:
    (failed,) = table.failed_bounds([*OURS, *rows("dynesty", 20.0, (0.0, 0.1))])
    assert "only 20 times ours" in failed


def test_our_wrong_evidence_breaks_a_bound() -> None:
    (failed,) = table.failed_bounds(rows("shm", 1.0, (0.5, 0.6)))
    assert "bias +0.55" in failed


def test_a_failed_run_is_told_with_its_reason() -> None:
    failed = {"peer": "uqpy", "repeat": 1, "sigma": "sampled", "seed": 1, "failure": "no memory"}
    (line,) = table.failures([*OURS, failed])
    assert "1 of 1 runs failed (no memory)" in line


def test_the_tables_stand_between_the_marks_and_the_text_stays(tmp_path: Path) -> None:
    page = tmp_path / "peers.md"
    page.write_text("before\n<!-- peers -->\nold\n<!-- /peers -->\nafter\n")
    table.write_docs(OURS, page)
    text = page.read_text()
    assert text.startswith("before\n<!-- peers -->")
    assert text.endswith("<!-- /peers -->\nafter\n")
    assert "**shm** 1 1 s, bias " in text
    whole = (tmp_path / "peers" / "n_d_1.csv").read_text()
    assert '**shm** 1,integrated,3,1,1,"1,000",' in whole
    assert "old" not in text


def test_every_sampler_has_a_script_a_title_and_pinned_versions() -> None:
    command = loaded(BENCHMARKS / "peers.py")
    assert command.ENVIRONMENTS.keys() == table.TITLES.keys()
    for peer, environment in command.ENVIRONMENTS.items():
        assert (BENCHMARKS / "peers" / f"run_{peer}.py").is_file()
        pinned = BENCHMARKS / "peers" / "requirements" / f"{environment}.txt"
        lines = pinned.read_text().splitlines() if environment else []
        assert all("==" in line for line in lines)


def test_ours_is_planned_with_sigma_integrated_out_and_more_seeds() -> None:
    command = loaded(BENCHMARKS / "peers.py")
    cases = [command.Case(1, "sampled"), command.Case(1, "integrated")]
    jobs = command.planned(["shm", "emcee"], cases, seeds=2)
    assert {(job.case.sigma, job.seed) for job in jobs if job.peer == "shm"} == {
        ("integrated", seed) for seed in range(1, command.OUR_SEEDS + 1)
    }
    assert sum(job.peer == "emcee" for job in jobs) == 4
    assert command.planned(["shm", "emcee"], cases, seeds=0) == []
