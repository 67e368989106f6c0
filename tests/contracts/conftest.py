from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run each call in an empty folder, so that no workspace is at hand."""
    monkeypatch.delenv("SHM_WORKSPACE", raising=False)
    monkeypatch.chdir(tmp_path)
