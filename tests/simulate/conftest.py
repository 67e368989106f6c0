from __future__ import annotations

import pytest

from shm.values import Hanger
from tests.helpers.hangers import ROD


@pytest.fixture(scope="session")
def hanger() -> Hanger:
    return ROD
