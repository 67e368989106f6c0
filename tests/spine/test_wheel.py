"""The wheel holds everything that the command line needs, outside of the checkout."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RUN = "import sys; from shm_cli.main import main; main(sys.argv[1:])"


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder)]
    subprocess.run([*build, str(ROOT)], check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def run(unpacked: Path, code: str, *arguments: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(unpacked), "PYTHONDONTWRITEBYTECODE": "1"}
    finished = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=unpacked,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert finished.returncode == 0, finished.stderr
    return finished.stdout


def test_a_workspace_can_be_made_and_asked_from_the_wheel(unpacked: Path) -> None:
    where = run(unpacked, "import shm, shm_daemon, shm_cli; print(shm.__file__)")
    assert where.startswith(str(unpacked))
    bridge = unpacked.parent / "bridge"
    run(unpacked, RUN, "init", str(bridge))
    assert "0" in run(unpacked, RUN, "--workspace", str(bridge), "status", "--json")


def test_data_and_templates_are_in_the_wheel(unpacked: Path) -> None:
    code = (
        "from shm_cli import thesis, demo; import shm.report.as_html; from shm import resources\n"
        "from shm.bridge import load_hanger\n"
        "assert all(path.is_file() for path in thesis.PRINTINGS.values())\n"
        "assert load_hanger(thesis.HANGER_FILE).id == 3\n"
        "assert resources.default_config().is_file() and resources.migrations_folder().is_dir()\n"
        "units = ('shm.service', 'shm-web.service', 'shm-backup.service', 'shm-backup.timer')\n"
        "assert all(resources.unit_file(name).is_file() for name in units)\n"
    )
    run(unpacked, code)
    names = {path.name for path in unpacked.rglob("*") if path.is_file()}
    assert {"paper.html.j2", "report.css", "calibration.toml", "default.toml", "env.py"} <= names
    assert "py.typed" in names
    assert not any(name.endswith((".pyc", ".db")) for name in names)
