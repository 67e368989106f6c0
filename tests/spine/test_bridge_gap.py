"""bridge.toml on the gap diagnosis: ranges of effects and the scatter of a bar as made."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.bridge import load_hanger
from shm.errors import BadInput
from shm.models.effects import check_effect_priors
from shm.values import NAN, EffectPrior, Hanger, Scatter
from tests.helpers.comparing import assert_same
from tests.spine.test_bridge import ROUND, written

HANGERS_PAGE = Path(__file__).resolve().parents[2] / "docs" / "hangers.md"


def loaded(folder: Path, text: str) -> Hanger:
    return load_hanger(written(folder, ROUND + text))


def test_without_tables_the_catalogue_and_the_usual_scatter_hold(tmp_path: Path) -> None:
    hanger = loaded(tmp_path, "")
    assert hanger.effect_priors == ()
    assert hanger.scatter == Scatter()


def test_ranges_of_effects_are_read_in_the_order_of_the_file(tmp_path: Path) -> None:
    text = "[hanger.effects.point_mass]\nmass_kg = [1, 50]\nx_m = [0.5, 4]\n"
    text += "[hanger.effects.sag]\nsag_parameter = [0.01, 1]\n"
    assert loaded(tmp_path, text).effect_priors == (
        EffectPrior("point_mass", "mass_kg", 1.0, 50.0),
        EffectPrior("point_mass", "x_m", 0.5, 4.0),
        EffectPrior("sag", "sag_parameter", 0.01, 1.0),
    )


def test_scatter_that_is_left_out_is_the_usual_one(tmp_path: Path) -> None:
    hanger = loaded(tmp_path, "[hanger.scatter]\nsection = 0.01\nlength = 0\n")
    assert_same(hanger.scatter, Scatter(section=0.01, length=0.0))


@pytest.mark.parametrize(("by", "sd"), [("faces", NAN), ("pins", 0.0468), ("nodes", 0.0324)])
def test_how_a_length_was_taped_says_how_well_the_swinging_one_is_known(
    by: str, sd: float, tmp_path: Path
) -> None:
    hanger = loaded(tmp_path, f'length_by = "{by}"\n')
    assert hanger.scatter.effective_length == pytest.approx(sd, rel=0.01, nan_ok=True)
    stated = loaded(tmp_path, f'length_by = "{by}"\n[hanger.scatter]\neffective_length = 0.01\n')
    assert stated.scatter.effective_length == 0.01
    with pytest.raises(BadInput, match="no way to tape a hanger"):
        loaded(tmp_path, 'length_by = "eye"\n')


def test_how_a_bar_was_measured_is_read_as_stated(tmp_path: Path) -> None:
    nothing = loaded(tmp_path, "").survey
    assert (nothing.length_by, nothing.length_measured, nothing.measured_by) == ("", "", "")
    assert "fittings_m" not in nothing.stated_keys
    text = 'length_by = "faces"\nlength_measured = "tape, 2026-04"\nmeasured_by = " Ann "\n'
    stated = loaded(tmp_path, f"{text}fittings_m = [0, 0]\n[hanger.supports]\n").survey
    assert stated.length_by == "faces"
    assert (stated.length_measured, stated.measured_by) == ("tape, 2026-04", "Ann")
    assert {"fittings_m", "supports"} <= set(stated.stated_keys)
    for wrong in ("measured_by = 3", 'length_measured = "a\\nb"'):
        with pytest.raises(BadInput, match="is not a text"):
            loaded(tmp_path, wrong)


def test_the_manuals_example_is_read_and_allowed(tmp_path: Path) -> None:
    section = HANGERS_PAGE.read_text(encoding="utf-8").split("## Ranges of effects")[1]
    hanger = loaded(tmp_path, section.split("```toml\n")[1].split("```")[0])
    check_effect_priors(hanger)
    assert len(hanger.effect_priors) == 3
    assert_same(hanger.scatter, Scatter(0.01, 0.002, 0.0005, 0.01))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[hanger.effects]\npoint_mass = 3", "effects: point_mass is not a table"),
        ("[[hanger.effects]]\nsag = 3", "effects is not a table"),
        ("[hanger.effects.sag]\nsag_parameter = 3", "effects.sag: sag_parameter = 3 is not a rang"),
        ("[hanger.effects.sag]\nsag_parameter = [1]", r"sag_parameter = \[1\] is not a range"),
        ("[hanger.effects.sag]\nsag_parameter = [1, 2, 3]", "is not a range"),
        ("[hanger.effects.sag]\nsag_parameter = [1, 'a']", "is not a range"),
        ("[hanger.effects.sag]\nsag_parameter = [false, true]", "is not a range"),
        ("[hanger.effects.sag]\nsag_parameter = [1, inf]", "is not a range"),
        ("[hanger.effects.sag]\nsag_parameter = [2, 1]", r"\[2, 1\] does not rise"),
        ("[hanger.scatter]\nwidth = 0.1", "scatter: unknown key width"),
        ("[hanger.scatter]\nlength = 0.6", "length = 0.6 is not from 0 to 0.5"),
        ("[hanger.scatter]\nlength = -0.1", "length = -0.1 is not from 0 to 0.5"),
        ("[hanger.scatter]\nlength = 'small'", "length = 'small' is not a number"),
    ],
)
def test_what_is_no_range_is_named(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(BadInput, match=complaint) as refusal:
        loaded(tmp_path, text)
    assert "[[hanger]] id 3" in str(refusal.value)
    assert refusal.value.remedy
