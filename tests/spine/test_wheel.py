"""The wheel holds everything that the command line needs, outside of the checkout.

It is built from what the container's file copies, installed with no index to ask, and called with
no right to change what is installed: an image as far as a test can make one.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

ROOT = Path(__file__).resolve().parents[2]
# Root may do everything by its capabilities alone: without them it is a user like any other.
PLAIN_USER = ["setpriv", "--bounding-set=-all", "--inh-caps=-all"] if os.geteuid() == 0 else []
RUN = "import sys; from shm_cli.main import main; main(sys.argv[1:])"


@pytest.fixture(scope="module")
def unpacked() -> Iterator[Path]:
    with TemporaryDirectory() as made:
        folder = Path(made)
        built_from = folder / "source"
        built_from.mkdir()
        for name in copied_by_the_container():
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copyfile
            copy(ROOT / name, built_from / name)
        build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", made]
        subprocess.run([*build, str(built_from)], check=True, capture_output=True)
        (wheel,) = folder.glob("*.whl")
        assert not [name for name in zipfile.ZipFile(wheel).namelist() if name.endswith(".pyc")]
        site = folder / "site"
        called = [sys.executable, "-m", "pip", "install", "--no-index", "--no-deps"]
        called += ["--target", str(site), str(wheel)]
        subprocess.run(called, check=True, capture_output=True)
        for path in (site, *site.rglob("*")):
            path.chmod(path.stat().st_mode & ~0o222)
        yield site
        for path in (site, *site.rglob("*")):
            path.chmod(path.stat().st_mode | 0o200)


def copied_by_the_container() -> list[str]:
    text = (ROOT / "config" / "container" / "Containerfile").read_text()
    return [
        name
        for line in re.findall(r"^COPY (?!--from)(.+)$", text, re.M)
        for name in line.split()[:-1]
    ]


def run(unpacked: Path, code: str, *arguments: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(unpacked), "PYTHONDONTWRITEBYTECODE": "1"}
    finished = subprocess.run(
        [*PLAIN_USER, sys.executable, "-c", code, *arguments],
        cwd=unpacked,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert finished.returncode == 0, finished.stdout + finished.stderr
    return finished.stdout


def test_a_workspace_can_be_made_and_asked_from_the_wheel(unpacked: Path) -> None:
    where = run(unpacked, "import shm, shm_daemon, shm_cli; print(shm.__file__)")
    assert where.startswith(str(unpacked))
    bridge = unpacked.parent / "bridge"
    with pytest.raises(AssertionError, match="PermissionError"):
        run(unpacked, "open('shm/further.py', 'w')")
    run(unpacked, RUN, "init", str(bridge))
    assert "0" in run(unpacked, RUN, "--workspace", str(bridge), "status", "--json")
    run(unpacked, RUN, "--workspace", str(bridge), "doctor")  # 0: no fault, warnings are none


def test_data_and_templates_are_in_the_wheel(unpacked: Path) -> None:
    code = (
        "from shm_cli import example, demo; import shm.report.as_html; from shm import resources\n"
        "from shm.bridge import load_hanger\n"
        "assert example.MODES_FILE.is_file()\n"
        "assert load_hanger(example.HANGER_FILE).id == 3\n"
        "assert resources.default_config().is_file() and resources.migrations_folder().is_dir()\n"
        "units = ('shm.service', 'shm-web.service', 'shm-backup.service', 'shm-backup.timer')\n"
        "assert all(resources.unit_file(name).is_file() for name in units)\n"
    )
    run(unpacked, code)
    names = {path.name for path in unpacked.rglob("*") if path.is_file()}
    assert {"paper.html.j2", "report.css", "calibration.toml", "default.toml"} <= names
    assert {"assumptions.csv", "env.py"} <= names
    assert "py.typed" in names
    assert not any(name.endswith(".db") for name in names)
