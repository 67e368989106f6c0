"""What a test says of its frequencies' dependence on amplitude enters the diagnosis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap import GapOptions, diagnose
from shm.gap.noise import nodes
from shm.gap.observations import observed
from shm.simulate import HangerState, PlantedEffect
from shm.values import NAN, AddedMass, ModalTest, Mode
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import HANGER as PLAIN
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.campaign import CampaignPlan, campaign

SLIP = PlantedEffect("joint_softening", "both ends", {"log10_k_at_reference_level": 8.3})
KNOWN = ("joint_softening", "rotational_end_flexibility")
PLAN = CampaignPlan(modes=6, temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0)
SLOPE, SLOPE_SD, SD = -2e-3, 3e-5, 2e-4


def _mode(order: int, slope: float = NAN, plane: str = "transverse") -> Mode:
    hz = 6.0 * order
    return Mode(plane, order, hz, SD * hz, amplitude_slope=slope, amplitude_slope_sd=SLOPE_SD)  # type: ignore[arg-type]


def test_a_test_counts_at_small_amplitude_and_at_that_of_its_hits() -> None:
    test = ModalTest("t", (_mode(1, SLOPE), _mode(2)), amplitude=0.7, added_mass=AddedMass(9, 2))
    found = observed([test], HANGER_3)
    assert [each.amplitude for each in found.design.conditions] == [0.0, 0.7]
    assert {each.added_mass for each in found.design.conditions} == {test.added_mass}
    assert found.design.frequency_test.tolist() == [0, 0, 1]
    assert found.design.survey.tests == ("t",)
    assert found.value[2] - found.value[0] == pytest.approx(np.log1p(SLOPE))


@pytest.mark.parametrize("slope", [NAN, 0.5 * SLOPE_SD, 0.03])
def test_a_slope_that_is_unknown_unsure_or_absurd_changes_nothing(slope: float) -> None:
    found = observed([ModalTest("t", (_mode(1, slope), _mode(2)), amplitude=0.7)], HANGER_3)
    assert [each.amplitude for each in found.design.conditions] == [0.7]


def test_both_frequencies_of_a_mode_share_their_error_but_that_of_the_slope() -> None:
    """ln f1 - ln f0 = ln(1 + c): its variance is that of c, whatever that of f0 and the model; and
    two planes that overlap, whose errors correlate, leave a proper covariance."""
    both = [
        _mode(order, SLOPE, plane) for plane in ("transverse", "longitudinal") for order in (1, 2)
    ]
    found = observed([ModalTest("t", tuple(both), amplitude=1.0)], HANGER_3)
    weights = np.zeros(8)
    weights[0], weights[4] = -1, 1
    seen = [node.covariance.frequency for node in nodes(found)]
    factors = {round(float(weights @ each @ weights) / SLOPE_SD**2, 2) for each in seen}
    assert 1.0 in factors
    assert len(factors) == 5  # of stated standard deviations, see the module
    assert min(np.linalg.eigvalsh(each).min() for each in seen) > 0.1 * SLOPE_SD**2


@pytest.mark.slow
def test_the_slopes_of_one_test_name_the_joint_that_slips() -> None:
    def at(amplitude: float) -> ModalTest:
        plan, rng = replace(PLAN, amplitudes=(amplitude,)), np.random.default_rng(5)
        return campaign(PLAIN, HangerState(711e3), [SLIP], plan, rng)[0]

    small, hit = at(1e-3), at(1.0)
    slopes = [
        two.frequency_hz / one.frequency_hz - 1
        for one, two in zip(small.modes, hit.modes, strict=True)
    ]
    modes = [
        replace(mode, amplitude_slope=slope, amplitude_slope_sd=2e-5)
        for mode, slope in zip(small.modes, slopes, strict=True)
    ]
    told = replace(small, modes=tuple(modes), amplitude=1.0)
    options = GapOptions(without=all_but(*KNOWN))
    found = diagnose([told], PLAIN, options)
    assert found.leading is not None
    assert found.leading.effect == "joint_softening"
    assert found.leading.probability > 0.9
    size = found.leading.parameters[0]
    assert size.mean == pytest.approx(8.3, abs=4 * size.sd)
    assert any("depend on amplitude" in remark for remark in found.remarks)
    assert "joint_softening" in dict(
        diagnose([replace(told, modes=hit.modes)], PLAIN, options).invisible
    )
