"""Pages of the manual are followed and read: first report, README, descriptions, equations."""

from __future__ import annotations

import importlib.util
import os
import re
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from sphinx.errors import SphinxError

from tests.cli.conftest import Shm
from tests.helpers.command_lines import fenced_commands, words_of
from tests.helpers.logger_exports import simulate_test
from tests.helpers.pages import DOCS, PAGES, ROOT, name_of
from tests.helpers.painting import unpaint

PAGE = Path(__file__).resolve().parents[2] / "docs" / "first_report.md"
COMMANDS = [line for line in fenced_commands(PAGE) if not line.endswith("--help")]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the reader is: with the description; fewer samples and blank figures, to be quick."""
    described = re.search(r"^```toml\n(.*?)^```$", PAGE.read_text(), re.M | re.S)
    assert described is not None
    (tmp_path / "mill.toml").write_text(described[1])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SHM_SAMPLES", "200")
    unpaint(monkeypatch)
    return tmp_path


@pytest.mark.slow
def test_page_leads_to_report(shm: Shm, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said: dict[str, str] = {}
    for line in COMMANDS:
        ended = shm(*_globbed(words_of(line)))
        assert ended.code == 0, f"{line}: {ended.err}"
        said[line] = ended.out
        if line.startswith("shm init"):
            assert "export SHM_WORKSPACE=mill" in PAGE.read_text()
            monkeypatch.setenv("SHM_WORKSPACE", "mill")
    assert (folder / "hanger1.pdf").read_bytes().startswith(b"%PDF")
    assert "<html" in (folder / "hanger1.html").read_text()
    report = shm("report", "--hanger", 1, "--json").document
    tension = report["posterior"]["tension_n"]
    assert tension["q05"] < 380e3 < tension["q95"]
    assert "done" in said["shm ingest tests/*.csv"]


def _globbed(words: list[str]) -> list[str]:
    """As a shell does it."""
    return [
        found
        for word in words
        for found in (sorted(str(path) for path in Path().glob(word)) if "*" in word else [word])
    ]


def test_a_page_of_more_than_one_shell_variable_would_need_more_of_this_test() -> None:
    assert re.findall(r"^export (\w+)=", PAGE.read_text(), re.M) == ["SHM_WORKSPACE"]
    assert "SHM_WORKSPACE" not in os.environ


ANSWERS = {
    "unit": ("column_2=N", "column_3=m/s2", "column_4=m/s2"),
    "place": ("2.52,2.52",),
    "plane": ("transverse,longitudinal",),
}


def commands_of_section() -> list[str]:
    section = (ROOT / "README.md").read_text().split("## Your own bridge\n")[1].split("\n## ")[0]
    block = re.search(r"^```sh\n(.*?)^```$", section, re.M | re.S)
    assert block is not None
    return [line.partition(" #")[0].removeprefix(".venv/bin/") for line in block[1].splitlines()]


def test_readme_leads_to_a_report(
    shm: Shm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SHM_SAMPLES", "200")
    unpaint(monkeypatch)
    found = simulate_test()
    rows = zip(*(channel.values for channel in found.channels), strict=True)
    Path("hanger3.csv").write_text(
        "".join(
            f"{n / found.sampling_rate_hz:.6f},{','.join(f'{value:.5g}' for value in row)}\n"
            for n, row in enumerate(rows)
        )
    )
    lines = commands_of_section()
    assert lines[1].split()[3] == "import"
    for line in lines:
        words = words_of(line)
        if "import" in words:  # there is no terminal here to ask at
            words += [w for key, values in ANSWERS.items() for v in values for w in (f"--{key}", v)]
        ended = shm(*words)
        assert ended.code == 0, f"{line}: {ended.err}"
    assert "<html" in Path("hanger3.html").read_text()


def blocks(page: str, kind: str) -> list[str]:
    text = (DOCS / page).read_text()
    return re.findall(rf"^```{kind}\n(.*?)^```$", text, re.M | re.S)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_description_of_a_page_is_toml(page: Path) -> None:
    for block in blocks(f"{name_of(page)}.md", "toml"):
        if "# ..." not in block:
            assert tomllib.loads(block)


@pytest.fixture(scope="module")
def drawn_math() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "drawn_math", DOCS / "extensions" / "drawn_math.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_equation_of_the_physics_can_be_drawn(drawn_math: ModuleType) -> None:
    text = (DOCS / "physics.md").read_text()
    displayed = re.findall(r"\$\$(.+?)\$\$", text, re.S)
    lines = [line for block in displayed for line in block.split(r"\\")]
    inline = re.findall(r"(?<!\$)\$([^$\n]+)\$(?!\$)", re.sub(r"\$\$.+?\$\$", "", text, flags=re.S))
    assert len(lines) > 10
    assert len(inline) > 30
    for equation in (*lines, *inline):
        drawn = drawn_math.drawing(equation, 1.0)
        assert drawn.count("<svg") == 1
        assert 'fill="currentColor"' in drawn
    with pytest.raises(SphinxError, match="frobnicate"):
        drawn_math.drawing(r"\frobnicate{x}", 1.0)
