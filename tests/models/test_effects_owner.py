"""The owner's ranges of effects: in force where they can be, refused by name where they cannot."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shm.errors import BadInput
from shm.models.effects import Variant, check_effect_priors, parameters_of
from shm.values import EffectPrior, Hanger
from tests.helpers.hangers import HANGER_3


def with_prior(effect: str, parameter: str, lower: float, upper: float) -> Hanger:
    return replace(HANGER_3, effect_priors=(EffectPrior(effect, parameter, lower, upper),))


def test_the_owners_range_replaces_the_catalogues_and_nothing_else() -> None:
    own = with_prior("point_mass", "mass_kg", 1, 50)
    check_effect_priors(own)
    mass, place = parameters_of("point_mass", own, Variant())
    usual_mass, usual_place = parameters_of("point_mass", HANGER_3, Variant())
    assert (mass.lower, mass.upper) == (1, 50)
    assert replace(mass, lower=usual_mass.lower, upper=usual_mass.upper) == usual_mass
    assert place == usual_place


@pytest.mark.parametrize(
    ("prior", "complaint"),
    [
        (("magic", "size", 1, 2), r"\[hanger.effects.magic\] is no effect"),
        (("point_mass", "weight", 1, 2), r"\[hanger.effects.point_mass\] has no parameter weight"),
        (("point_mass", "mass_kg", 50, 1), r"mass_kg = \[50, 1\] does not rise"),
        (("point_mass", "mass_kg", 1, 1), "does not rise"),
        (("point_mass", "mass_kg", 0, 1), r"mass_kg = \[0, 1\] is not above 0"),
        (("timebase", "clock_error", -0.01, 0.01), "both signs"),
        (("point_mass", "x_m", 3, 13), r"Stay within 0 and 12 m"),
        (("section_loss", "loss", 0.1, 1), "Stay within 0 and 0.99 fraction"),
        (("shear_and_rotary_inertia", "share", -1, 1), "beyond what can be"),
    ],
)
def test_a_range_that_cannot_be_is_refused_with_what_to_do(prior: tuple, complaint: str) -> None:
    with pytest.raises(BadInput, match=complaint) as refusal:
        check_effect_priors(with_prior(*prior))
    assert "hanger 3" in str(refusal.value)
    assert refusal.value.remedy
