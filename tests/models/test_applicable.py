"""Which model classes apply to a hanger, and what the others say."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shm.errors import UsageError
from shm.models import MODELS, applicable, competing_names
from shm.models.beam import Beam1
from shm.values import Hanger
from tests.helpers.hangers import HANGER_3


class Plated(Beam1):
    """A class that needs end plates."""

    name = "plated"

    @classmethod
    def unfit(cls, hanger: Hanger) -> str:
        return "" if hanger.plate else "it needs end plates."


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(MODELS, "plated", Plated)


BARE = replace(HANGER_3, plate=None)


def test_a_class_that_cannot_describe_the_hanger_says_why() -> None:
    names = ["beam1", "plated", "beam2"]
    assert applicable(HANGER_3, names) == (("beam1", "plated", "beam2"), {})
    assert applicable(BARE, names) == (("beam1", "beam2"), {"plated": "it needs end plates."})


def test_where_no_class_applies_every_reason_is_given() -> None:
    assert competing_names(BARE, ["beam1", "plated"]) == ("beam1",)
    with pytest.raises(UsageError, match=r"hanger 3.*plated: it needs end plates"):
        competing_names(BARE, ["plated"])
