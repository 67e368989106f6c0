from __future__ import annotations

from pathlib import Path

import pytest

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
        any_bar = "doubts_of_bars" not in request.fixturenames
        quick_update.stand_in(monkeypatch.setattr, any_bar=any_bar)


@pytest.fixture
def real_sampler() -> None:
    """Asks for the real sampler."""


@pytest.fixture
def doubts_of_bars() -> None:
    """Asks for the check of which hanger modes are of."""
