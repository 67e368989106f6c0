"""One table of settings feeds file, environment, flags and help."""

from __future__ import annotations

from typing import get_args, get_type_hints

import pytest

from shm.errors import BadInput
from shm.identify import IDENTIFIERS, IdentifyOptions
from shm.identify.options import AUTO_CROSS_CHECK, NO_CROSS_CHECK
from shm.settings import TABLE, Settings, load_settings


def test_defaults_are_within_their_own_bounds() -> None:
    for row in TABLE:
        assert row.parse(row.default, "table") == row.default


def test_every_row_explains_itself() -> None:
    for row in TABLE:
        assert row.help
        assert row.environment_variable == f"SHM_{row.name.upper()}"


def test_a_flag_beats_the_environment_beats_the_file_beats_the_default() -> None:
    file, environment = {"samples": 200}, {"SHM_SAMPLES": "300"}
    assert load_settings({}, {}, {}).samples == Settings().samples
    assert load_settings(file, {}, {}).samples == 200
    assert load_settings(file, {}, environment).samples == 300
    assert load_settings(file, {"samples": 400}, environment).samples == 400
    assert load_settings(file, {"samples": None}, environment).samples == 300


@pytest.mark.parametrize("value", [1, 2.5, "many", 10_000_000, None, [3]])
def test_a_value_that_does_not_fit_is_refused_with_its_source(value: object) -> None:
    with pytest.raises(BadInput, match=r"bridge\.toml.*samples.*from 100 to 1e\+06"):
        load_settings({"samples": value}, {}, {})


def test_the_environment_is_named_when_it_is_at_fault() -> None:
    with pytest.raises(BadInput, match="SHM_WORKERS"):
        load_settings({}, {}, {"SHM_WORKERS": "none"})


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(BadInput, match=r"unknown setting 'sampels'.*samples"):
        load_settings({"sampels": 200}, {}, {})


def test_model_names_are_split_and_trimmed() -> None:
    assert load_settings({"models": " beam1, beam2,"}, {}, {}).model_names == ("beam1", "beam2")
    assert load_settings({"models": ["beam1", "beam2"]}, {}, {}).model_names == ("beam1", "beam2")


@pytest.mark.parametrize(
    ("name", "value"),
    [("models", [1, 2]), ("models", 3), ("models", {}), ("web_hosts", True), ("workers", True)],
)
def test_a_value_of_another_kind_is_refused_where_it_is_given(name: str, value: object) -> None:
    with pytest.raises(BadInput, match=f"setting {name} = "):
        load_settings({name: value}, environment={})


@pytest.mark.parametrize("name", ["identifier", "cross_check", "estimator"])
def test_a_name_that_is_none_of_the_choices_is_refused_with_them(name: str) -> None:
    with pytest.raises(BadInput, match=f"setting {name} = 'best' is none of") as caught:
        load_settings({name: "best"}, environment={})
    assert getattr(Settings(), name) in caught.value.remedy


def test_choices_of_former_versions_have_a_successor() -> None:
    found = load_settings({"identifier": "frf", "cross_check": "frf"}, environment={})
    assert (found.identifier, found.cross_check) == ("ssi", "auto")


def test_every_identifier_can_be_chosen() -> None:
    choices = {row.name: set(row.choices) for row in TABLE}
    assert choices["identifier"] == set(IDENTIFIERS)
    assert choices["cross_check"] == {*IDENTIFIERS, NO_CROSS_CHECK, AUTO_CROSS_CHECK}
    assert choices["estimator"] == set(get_args(get_type_hints(IdentifyOptions)["estimator"]))
