from __future__ import annotations

from pathlib import Path

import pytest

from shm.store import Workspace
from tests.helpers.workspaces import make_workspace


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return make_workspace(tmp_path / "bridge")
