"""The wheel of `make wheel` works in an empty environment, away from the checkout."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from shm.store import Stage
from tests.helpers.pages import ROOT
from tests.helpers.waiting import until


@pytest.fixture(scope="module")
def installed() -> Iterator[Path]:
    """Install the wheel and its web interface into an environment, as docs/install.md says."""
    subprocess.run(["make", "wheel"], cwd=ROOT, check=True, capture_output=True)
    wheel = max((ROOT / "dist").glob("shm-*.whl"), key=lambda path: path.stat().st_mtime)
    uv = Path(sys.executable).with_name("uv")
    with TemporaryDirectory() as made:
        environment = Path(made) / "environment"
        subprocess.run([sys.executable, "-m", "venv", str(environment)], check=True)
        words = ["--python", str(environment), "--constraint", str(ROOT / "requirements-dev.txt")]
        call = [str(uv), "pip", "install", *words, f"shm[web] @ {wheel.as_uri()}"]
        ended = subprocess.run(call, cwd=made, capture_output=True, text=True, check=False)
        if ended.returncode:
            pytest.skip(f"NOT TESTED: the wheel's libraries cannot be had: {ended.stderr[-500:]}")
        yield environment


def shm(installed: Path, *words: str) -> list[str]:
    return [str(installed / "bin" / "shm"), *words]


def bare(installed: Path) -> dict[str, str]:
    """Return an environment in which nothing of ours is found but what is installed."""
    return {"HOME": str(installed.parent), "PATH": f"{installed}/bin:/usr/bin:/bin"}


def run(installed: Path, *words: str) -> str:
    ended = subprocess.run(
        shm(installed, *words),
        cwd=installed.parent,
        env=bare(installed),
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.mark.slow
def test_installed_wheel_has_manual(installed: Path) -> None:
    page = Path(run(installed, "manual").strip())
    assert page.is_relative_to(installed)
    for name in ("index", "publishing", "install", "commands"):
        assert f"{name}.html" in {each.name for each in page.parent.glob("*.html")}


@pytest.mark.slow
def test_installed_wheel_runs_first_minute_of_demo(installed: Path) -> None:
    folder = installed.parent / "demo"
    where = run(installed, "doctor", "--help")
    assert str(ROOT) not in where
    demo = subprocess.Popen(
        shm(installed, "demo", "--folder", str(folder)),
        cwd=installed.parent,
        env=bare(installed),
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )

    def n_identified() -> int:
        assert demo.poll() is None, demo.stderr.read() if demo.stderr else ""
        if not (folder / "shm.db").is_file():
            return 0
        document = json.loads(run(installed, "--workspace", str(folder), "status", "--json"))
        assert not document["recordings"]["refused"]
        return sum(document["recordings"][stage] for stage in (*Stage,)[1:])

    try:
        until(lambda: n_identified() >= 3, 240.0)
    finally:
        os.killpg(demo.pid, signal.SIGTERM)
        demo.communicate(timeout=60)
