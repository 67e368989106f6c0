"""The README's "Your own bridge" is followed, with a logger's file that has no heading."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.cli.conftest import Shm
from tests.helpers.command_lines import words_of
from tests.helpers.logger_exports import simulate_test
from tests.helpers.pages import ROOT
from tests.helpers.painting import unpaint

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
