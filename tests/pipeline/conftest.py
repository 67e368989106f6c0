from __future__ import annotations

from pathlib import Path

import pytest

from shm.pipeline import steps
from shm.store import Workspace
from tests.helpers import quick_update
from tests.helpers.workspaces import make_workspace


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return make_workspace(tmp_path / "bridge", hooks={"mail": ["true"]})


@pytest.fixture(autouse=True)
def _quick(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The flow is tested with a stand-in for the sampler, unless a test asks for the real one."""
    if "real_sampler" not in request.fixturenames:
        for verb in ("update", "refresh", "select"):
            monkeypatch.setattr(steps, verb, getattr(quick_update, verb))


@pytest.fixture
def real_sampler() -> None:
    """Asks for the real sampler."""
