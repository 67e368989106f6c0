"""What each effect does to a hanger, against closed forms and exact beams.

Where nothing else is said: hanger 3 at its nominal tension, clamped, frequencies of six modes a
plane. Beams are exact: `beam1` is the clamped beam under tension, `beam2` has end springs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from shm.models import THESIS, build
from shm.models.effects import EFFECTS, Conditions, Survey, Variant, parameters_of
from shm.models.hanger import HangerModes, PhysicalHanger, solve
from shm.models.hanger.physical import Zone
from shm.values import NAN, PLANES, Hanger
from tests.helpers.hangers import HANGER_3

MODES = 6
PLACES_M = np.array([1.2, 3.6, 5.1, 8.3])
ROD = replace(HANGER_3, plate=None)
RICH = Survey(("t1", "t2"), PLANES, tuple(PLACES_M), True, (2.0, 22.0), (0.5, 1.0), ())


def place(name: str, at: str, hanger: Hanger = ROD) -> Variant:
    found = {variant.at: variant for variant in EFFECTS[name].variants(hanger, RICH)}
    return found[at]


def physical(
    name: str = "",
    at: str = "everywhere",
    values: tuple[float, ...] = (),
    hanger: Hanger = ROD,
    conditions: Conditions = Conditions("t1"),  # noqa: B008
) -> PhysicalHanger:
    """One hanger with one effect, or with none."""
    tension_n = np.array([hanger.nominal_tension_n])
    bare = PhysicalHanger.clamped(hanger, tension_n, sensors=len(PLACES_M))
    if not name:
        return bare
    return EFFECTS[name].applied(
        bare, np.array([values]), place(name, at, hanger), conditions, hanger
    )


def solved(one: PhysicalHanger, places_m: np.ndarray = PLACES_M) -> HangerModes:
    return solve(one, MODES, places_m)


def frequencies(*args: object, **kwargs: object) -> np.ndarray:
    """(planes, modes)."""
    return solved(physical(*args, **kwargs)).frequency_hz[0]


def exact(kind: str, hanger: Hanger = ROD, **values: float) -> np.ndarray:
    """Frequencies of an exact beam (planes, modes)."""
    beam = build(kind, hanger, THESIS)
    theta: Mapping[str, float] = {"theta_F": 1.0, "theta_L": 1.0} | values
    return beam.frequencies_hz(beam.pack(theta)[None], MODES)[0]


CASES = [
    pytest.param(name, variant, id=f"{name}@{variant.key}")
    for name, effect in EFFECTS.items()
    for variant in effect.variants(ROD, RICH)
]


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_a_middling_size_moves_what_the_logger_reports(name: str, variant: Variant) -> None:
    """Frequencies or shapes, seen with small sizes also where the effect is most sensitive."""
    middle = [one.value(np.array([0.7]))[0] for one in parameters_of(name, ROD, variant)]
    conditions = Conditions(variant.test or "t1", 10.0, 1.0, tension_shift_n=2e4)
    bare = physical()
    with_effect = EFFECTS[name].applied(bare, np.array([middle]), variant, conditions, ROD)
    one, other = solved(bare), solved(with_effect)
    ratio = np.abs(other.frequency_hz / one.frequency_hz - 1).max()
    turned = np.abs(other.shape - one.shape).max()
    assert max(ratio, turned) > 1e-6


def test_springs_at_the_ends_give_the_beam_with_end_springs() -> None:
    k = {"log10_k1": 6.5, "log10_k2": 7.2, "log10_k3": 6.5, "log10_k4": 7.2}
    found = frequencies("rotational_end_flexibility", "both ends", (6.5, 7.2))
    np.testing.assert_allclose(found, exact("beam2", **k), rtol=1e-6)


def test_a_spring_at_one_end_in_one_plane_leaves_the_other_plane_alone() -> None:
    k = {"log10_k1": 12.0, "log10_k2": 12.0, "log10_k3": 12.0, "log10_k4": 6.5}
    found = frequencies("rotational_end_flexibility", "arch end, longitudinal", (6.5,))
    np.testing.assert_allclose(found, exact("beam2", **k), rtol=1e-5)


@pytest.mark.parametrize("at", ["deck end", "arch end", "both ends"])
def test_another_length_is_the_beam_of_that_length(at: str) -> None:
    found = frequencies("effective_length", at, (0.6,))
    np.testing.assert_allclose(found, exact("beam1", theta_L=12.6 / 12), rtol=1e-6)


def test_stiffness_in_one_plane_is_the_beam_of_that_stiffness_there() -> None:
    """Only EI depends on the modulus; a section with a diameter has one stiffness in all planes."""
    section = replace(ROD, diameter_m=NAN)
    stiffer = exact("beam1", replace(ROD, elastic_modulus_pa=1.3 * ROD.elastic_modulus_pa))
    found = frequencies("bending_stiffness", "everywhere, longitudinal", (0.3,), section)
    np.testing.assert_allclose(found[0], exact("beam1")[0], rtol=1e-6)
    np.testing.assert_allclose(found[1], stiffer[1], rtol=1e-6)


def test_mass_lowers_all_frequencies_alike() -> None:
    """f goes with one over the root of the mass."""
    found = frequencies("distributed_mass", values=(0.21,))
    np.testing.assert_allclose(found, frequencies() / 1.1, rtol=1e-9)


def test_a_slow_clock_raises_all_frequencies_alike_and_leaves_the_shapes() -> None:
    slow = solved(physical("timebase", "all tests", (0.003,)))
    np.testing.assert_allclose(slow.frequency_hz[0], 1.003 * frequencies(), rtol=1e-12)
    np.testing.assert_allclose(slow.shape, solved(physical()).shape)


def test_the_clock_of_another_test_is_right() -> None:
    found = frequencies("timebase", "test t2", (0.003,))
    np.testing.assert_allclose(found, frequencies(), rtol=1e-10)


def test_a_small_mass_lowers_each_mode_by_its_share_of_the_kinetic_energy() -> None:
    """Rayleigh: df/f = -m phi(x)^2 / (2 mu integral of phi^2)."""
    grid_m = np.linspace(0, 12, 2001)
    shape = solved(physical(), np.append(grid_m, 3.1)).shape[0, 0, :, :, 0]
    modal_kg = ROD.mass_per_length_kg_m * np.trapezoid(shape[:, :-1] ** 2, grid_m, axis=-1)
    found = frequencies("point_mass", values=(0.5, 3.1))[0] / frequencies()[0] - 1
    np.testing.assert_allclose(found, -0.5 * shape[:, -1] ** 2 / modal_kg / 2, rtol=5e-3)


def test_heavy_sensors_are_point_masses_at_their_places() -> None:
    found = physical("sensor_mass", "all sensors", (2.0,))
    one_by_one = physical()
    for place_m in PLACES_M:
        one_by_one = EFFECTS["point_mass"].applied(
            one_by_one, np.array([[2.0, place_m]]), Variant(), Conditions(), ROD
        )
    np.testing.assert_allclose(
        solved(found).frequency_hz, solved(one_by_one).frequency_hz, rtol=1e-12
    )


def test_section_lost_everywhere_is_a_thinner_bar() -> None:
    """Area falls by the loss, EI by its square."""
    left = 0.8
    thinner = replace(
        ROD,
        second_moment_m4=left**2 * ROD.second_moment_m4,
        mass_per_length_kg_m=left * ROD.mass_per_length_kg_m,
    )
    found = frequencies("section_loss", values=(1 - left, 6.0, 12.0))
    np.testing.assert_allclose(found, exact("beam1", thinner), rtol=1e-6)


def test_another_diameter_is_the_bar_of_that_diameter() -> None:
    """Mass goes with the square of the diameter, EI with its fourth power."""
    thicker = replace(
        ROD,
        second_moment_m4=1.04**4 * ROD.second_moment_m4,
        mass_per_length_kg_m=1.04**2 * ROD.mass_per_length_kg_m,
    )
    found = frequencies("section_size", values=(0.04,))
    np.testing.assert_allclose(found, exact("beam1", thicker), rtol=1e-6)


def test_stiff_zones_at_both_ends_raise_all_frequencies_less_than_rigid_ones() -> None:
    """Rigid zones that could not move at all would leave a shorter clamped bar."""
    found = frequencies("stiff_end_zones", "both ends", (0.4, 50.0))
    assert np.all(found > frequencies())
    assert np.all(found < exact("beam1", theta_L=11.2 / 12))


def test_shear_stiffness_is_that_of_a_round_steel_bar() -> None:
    """Kappa = 6 (1 + nu) / (7 + 6 nu) = 0.886 for nu = 0.3 (Cowper 1966)."""
    found = physical("shear_and_rotary_inertia", values=(1.0,))
    shear_n = 0.88636 * 200e9 / 2.6 * ROD.area_m2
    assert 1 / found.shear_compliance_1_n[0] == pytest.approx(shear_n, rel=1e-4)
    assert found.rotary_inertia_kg_m[0] == pytest.approx(7800 * ROD.second_moment_m4)


def test_shear_lowers_high_orders_most() -> None:
    fall = frequencies("shear_and_rotary_inertia", values=(1.0,))[0] / frequencies()[0] - 1
    assert np.all(np.diff(fall) < 0)
    assert np.all(fall < 0)


def test_sag_is_irvines_cable_where_bending_does_not_count() -> None:
    """tan(W/2) = W/2 - 4 (W/2)^3 / lambda^2 for the first symmetric mode, W = w L sqrt(m/T)."""
    cable = replace(ROD, second_moment_m4=1e-4 * ROD.second_moment_m4)
    found = frequencies("sag", "everywhere, transverse", (8.0,), hanger=cable)
    taut = frequencies(hanger=cable)
    half = brentq(lambda w: np.tan(w) - w + 4 * w**3 / 8.0, np.pi / 2 + 1e-9, np.pi - 1e-9)
    assert found[0, 0] / taut[0, 0] == pytest.approx(2 * half / np.pi, rel=5e-3)
    np.testing.assert_allclose(found[0, 1::2], taut[0, 1::2], rtol=1e-9)
    np.testing.assert_allclose(found[1], taut[1], rtol=1e-9)


def test_a_support_in_the_middle_leaves_the_modes_with_a_node_there() -> None:
    found = frequencies("intermediate_support", "everywhere, transverse", (1e5, 6.0))
    np.testing.assert_allclose(found[0, 1::2], frequencies()[0, 1::2], rtol=1e-8)
    assert np.all(found[0, ::2] > frequencies()[0, ::2])
    np.testing.assert_allclose(found[1], frequencies()[1], rtol=1e-6)


def test_a_light_fast_support_is_a_spring() -> None:
    """Far below the support's own frequency only its stiffness counts: m (2 pi f)^2."""
    mass_kg, frequency_hz = 400.0, 60.0
    stiffness = mass_kg * (2 * np.pi * frequency_hz) ** 2
    at = "deck end, transverse"
    moving = frequencies("support_motion", at, (mass_kg, frequency_hz))
    spring = frequencies("translational_end_flexibility", at, (np.log10(stiffness),))
    fall, as_spring = moving[0, 0] - frequencies()[0, 0], spring[0, 0] - frequencies()[0, 0]
    assert as_spring < -0.001
    assert fall == pytest.approx(as_spring, rel=0.05)


def test_a_slow_heavy_support_pushes_the_hangers_modes_up() -> None:
    """Above the support's own frequency its mass moves against the hanger."""
    found = frequencies("support_motion", "deck end, transverse", (4000.0, 1.0))
    assert np.all(found[0] > frequencies()[0])
    np.testing.assert_allclose(found[1], frequencies()[1], rtol=2e-6)


def test_each_other_law_of_a_support_swings_at_a_higher_frequency_of_its_own() -> None:
    """Between 1.5 and 6 times that of the first; a support of infinite mass has none."""
    effect, at = EFFECTS["support_motion"], place("support_motion", "deck end, transverse")
    values = np.array([[4000.0, 3.0], [np.inf, 3.0]])
    ratios = []
    for law in range(1, len(effect.other_laws) + 1):
        moved = effect.applied(
            PhysicalHanger.clamped(ROD, np.full(2, 711e3)),
            values,
            replace(at, law=law),
            Conditions("t1"),
            ROD,
        )
        (mode,) = moved.support_modes
        mass_kg, compliance = mode.mass_kg[0, 0, 0], mode.compliance_m_n[0, 0, 0]
        assert mass_kg > 4000.0
        assert np.count_nonzero(mode.mass_kg) == np.count_nonzero(mode.compliance_m_n) == 1
        ratios.append(1 / np.sqrt(mass_kg * compliance) / (2 * np.pi * 3.0))
    assert ratios == sorted(ratios)
    assert 1.5 < ratios[0] < ratios[-1] < 6.0


@pytest.mark.parametrize(("law", "edge"), [(0, 0.0), (1, 0.6), (3, 0.3)])
def test_a_loss_with_smooth_edges_is_met_best_by_its_law(law: int, edge: float) -> None:
    """Forty steps stand for an edge that is smooth over a share of the extent at each end."""
    effect, at = EFFECTS["section_loss"], place("section_loss", "everywhere")
    middle_m, extent_m, left = 3.0, 3.0, 0.5
    step = left ** (1 / 40)
    smooth = tuple(
        Zone(
            *(np.array([each]) for each in (middle_m - reach_m, middle_m + reach_m, step**2, step))
        )
        for reach_m in extent_m / 2 * np.linspace(1 - edge, 1 + edge, 40)
    )
    wanted = solved(replace(physical(), zones=smooth)).frequency_hz
    values = np.array([[1 - left, middle_m, extent_m]])
    found = [
        solved(effect.applied(physical(), values, replace(at, law=each), Conditions("t1"), ROD))
        for each in range(len(effect.other_laws) + 1)
    ]
    off = [np.abs(each.frequency_hz / wanted - 1).max() for each in found]
    assert int(np.argmin(off)) == law
    assert off[law] < 0.005


def test_warmth_and_level_change_the_tension() -> None:
    warm = Conditions("t1", temperature_shift_k=10.0, amplitude=2.0)
    slack = physical("temperature_tension", values=(-3000.0,), conditions=warm)
    tight = physical("geometric_hardening", values=(0.01,), conditions=warm)
    assert slack.tension_n == pytest.approx(711e3 - 30e3)
    assert tight.tension_n == pytest.approx(711e3 * 1.04)


def test_a_joint_is_a_spring_that_falls_with_the_level() -> None:
    half = Conditions("t1", amplitude=0.5)
    joint = frequencies("joint_softening", "deck end", (6.5,), conditions=half)
    k = 6.5 + np.log10(2.0)
    spring = frequencies("rotational_end_flexibility", "deck end", (k, k))
    np.testing.assert_allclose(joint, spring, rtol=1e-12)


def test_only_the_joints_part_of_an_end_spring_damps() -> None:
    """Springs in series share energy as compliance: 0.1 times level times share."""
    bare = replace(
        physical(), rotational_compliance_rad_n_m=np.full((1, 2, 2, 2), 3e-7) * np.eye(2)
    )
    joint = EFFECTS["joint_softening"].applied(
        bare, np.array([[7.0]]), place("joint_softening", "deck end"), Conditions(), ROD
    )
    np.testing.assert_allclose(joint.joint_loss_factor, [[0.1 * 0.25, 0.0]])


def test_a_turned_sensor_sees_a_mode_under_its_angle() -> None:
    """Turned by a from the transverse axis, it sees cos a and -sin a of a transverse motion."""
    seen = solved(physical("sensor_misalignment", "sensor at 3.60 m", (10.0,))).shape[0, 0, 0]
    straight = solved(physical()).shape[0, 0, 0]
    np.testing.assert_allclose(seen[[0, 2, 3], 1], 0, atol=1e-12)
    assert abs(seen[1, 1] / seen[1, 0]) == pytest.approx(np.tan(np.radians(10)))
    assert np.sign(seen[1, 1]) == -np.sign(straight[1, 0])


@pytest.mark.parametrize(("angle", "plane"), [(0.0, "transverse"), (90.0, "longitudinal")])
def test_an_axis_along_a_plane_is_a_spring_in_it(angle: float, plane: str) -> None:
    skewed = frequencies("skewed_principal_axes", "deck end", (6.5, angle))
    plain = frequencies("rotational_end_flexibility", f"deck end, {plane}", (6.5,))
    np.testing.assert_allclose(skewed, plain, rtol=1e-7)


def test_an_axis_at_45_degrees_makes_a_round_bar_swing_at_45_degrees() -> None:
    shape = solved(physical("skewed_principal_axes", "both ends", (6.0, 45.0))).shape
    np.testing.assert_allclose(np.abs(shape[..., 0]), np.abs(shape[..., 1]), atol=1e-6)


@pytest.mark.parametrize("name", ["rotational_end_flexibility", "translational_end_flexibility"])
def test_springs_alike_in_both_planes_are_two_of_one_size(name: str) -> None:
    one = frequencies(name, "deck end, both planes alike", (7.6,))
    np.testing.assert_allclose(one, frequencies(name, "deck end", (7.6, 7.6)), rtol=1e-10)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("section_loss", (0.1, 5.0, 1.0)),
        ("stiff_end_zones", (0.2, 3.0)),
        ("point_mass", (5.0, 4.0)),
        ("support_motion", (4000.0, 60.0)),
    ],
)
def test_another_law_of_an_effect_does_nearly_the_same(
    name: str, values: tuple[float, ...]
) -> None:
    """It changes frequencies by some percent of what the effect itself changes."""
    own = physical(name, place_of(name), values)
    variant = replace(place(name, place_of(name)), law=1)
    other = EFFECTS[name].applied(physical(), np.array([values]), variant, Conditions("t1"), ROD)
    bare, by_own, by_other = (solved(each).frequency_hz[0] for each in (physical(), own, other))
    apart = np.abs(by_other - by_own).max() / np.abs(by_own - bare).max()
    assert 1e-3 < apart < 0.3


def place_of(name: str) -> str:
    ends = {"stiff_end_zones": "both ends", "support_motion": "deck end, transverse"}
    return ends.get(name, "everywhere")
