"""The commands of a developer: few at the root, the others with the benchmarks."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from tests.helpers.makefiles import dry_run, make_targets

ROOT = Path(__file__).resolve().parents[2]
BENCHMARKS = ROOT / "tests" / "benchmarks"
AT_ROOT = {
    "demo", "demo-live", "test", "lint", "docs", "wheel", "image", "bench", "ablation", "lock",
    "clean",
}  # fmt: skip


def test_makefile_targets_at_root() -> None:
    assert make_targets(ROOT) == AT_ROOT


@pytest.mark.parametrize("folder", [ROOT, BENCHMARKS], ids=["root", "benchmarks"])
def test_makefile_first_comment_names_targets(folder: Path) -> None:
    comment = (folder / "Makefile").read_text(encoding="utf-8").partition("\n\n")[0]
    named = {word.strip(",") for line in comment.splitlines() for word in line[1:].split()}
    assert make_targets(folder) - {"environment"} <= named


@pytest.mark.parametrize("target", sorted(make_targets(BENCHMARKS) - {"environment", "lint"}))
def test_benchmark_target_runs_at_root(target: str) -> None:
    assert f"cd {ROOT} && " in dry_run(BENCHMARKS, target)


def test_make_test_runs_all_tests_and_checks() -> None:
    """As on other processors the numerics run in `make bench` (`every.TESTS`)."""
    shown = dry_run(ROOT, "test")
    assert "--ignore" not in shown
    assert not [word for word in shown.split() if word.endswith(".py")]
    for command in ("ruff check .", "ruff format --check .", "mypy", "lint-imports"):
        assert f"/{command}" in shown


@pytest.mark.parametrize("room", ["watch", "identify", "inference"])
def test_ablation_runs_the_benchmark_of_a_room(room: str) -> None:
    shown = dry_run(ROOT, "ablation", f"ROOM={room}", "ARGS=--help")
    script = f"tests/benchmarks/{room}_ablation.py"
    assert f"{script} --help" in shown
    assert (ROOT / script).is_file()


def test_make_image_is_that_of_compose() -> None:
    shown = dry_run(ROOT, "image", "CONTAINER=podman")
    (tag,) = re.findall(r"--tag (\S+) ", shown)
    compose = yaml.safe_load((ROOT / "config/container/compose.yaml").read_text())
    assert compose["services"]["daemon"]["image"] == tag
    (file,) = re.findall(r"--file (\S+)", shown)
    assert (ROOT / file).is_file()
    assert compose["services"]["daemon"]["build"]["dockerfile"] == file
