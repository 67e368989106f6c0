"""Which model classes apply to a hanger, and what the others say."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from shm.errors import UsageError
from shm.models import MODELS, applicable, build, competing_names
from shm.models.beam import Beam1
from shm.values import Hanger, Turnbuckle
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


@pytest.mark.parametrize(
    ("hanger", "complaint"),
    [
        (BARE, "plate"),
        (replace(BARE, diameter_m=math.nan), "round rod"),
        (replace(HANGER_3, turnbuckles=(Turnbuckle(6.0, 0.5, 80.0, 1e7),)), "turnbuckle"),
        (replace(HANGER_3, bending_stiffness_factor=0.5), "strand"),
    ],
    ids=["no plates", "not round", "turnbuckle", "strand"],
)
def test_the_solid_classes_say_what_they_miss_and_the_beams_serve(
    hanger: Hanger, complaint: str
) -> None:
    names = ["beam1", "beam2", "beam3", "solid0", "solid1", "solid2"]
    fitting, reasons = applicable(hanger, names)
    assert fitting == ("beam1", "beam2", "beam3")
    assert list(reasons) == ["solid0", "solid1", "solid2"]
    assert all(complaint in reason for reason in reasons.values())


def test_a_class_that_the_hanger_does_not_admit_says_so() -> None:
    fitting, reasons = applicable(replace(BARE, models=("beam2",)), ["beam1", "beam2"])
    assert fitting == ("beam2",)
    assert "admits beam2 only" in reasons["beam1"]


def test_an_unknown_class_among_the_hangers_own_is_told_with_the_hanger() -> None:
    wrong = replace(BARE, models=("beam2", "bean1"))
    for call in (lambda: build("beam2", wrong), lambda: applicable(wrong, ["beam1"])):
        with pytest.raises(UsageError, match=r"'bean1' in `models` of hanger 3"):
            call()


def test_where_no_class_applies_every_reason_is_given() -> None:
    assert competing_names(BARE, ["beam1", "plated"]) == ("beam1",)
    with pytest.raises(UsageError, match=r"hanger 3.*plated: it needs end plates"):
        competing_names(BARE, ["plated"])
