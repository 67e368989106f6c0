"""Compare fittings, turnbuckles, sag and inclination of a bar with finite elements.

The elements are those of `tests.worlds.eight_kinds`, which share nothing with the product.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from shm.bridge import load_hanger
from shm.errors import BadInput
from shm.inference.options import silent
from shm.inference.problem.hanger_problem import Problem
from shm.inference.sampler.density import DIFFERENCE
from shm.models import AsMade, described
from shm.models.classes.base import Conditions
from shm.models.hanger import solve
from shm.models.one_hanger.hanger_model import GRAVITY_M_S2
from shm.models.one_hanger.terms import FITTING_STIFFNESS, Term, terms_of
from shm.values import PLANES, AddedMass, FloatArray, Hanger, ModalTest, Mode, Turnbuckle
from tests.helpers.classes_as_made import as_made
from tests.worlds.eight_kinds import Member, Zone, natural_frequencies_hz

ROD = Hanger(1, 9.0, 205e9, 2.827e-3, 6.36e-7, 22.2, 180e3)
TUBE = replace(ROD, area_m2=1.635e-3, second_moment_m4=1.402e-6, mass_per_length_kg_m=12.83)
STRAND = Hanger(
    2, 24.0, 165e9, 8e-4, 1.2e-7, 6.6, 200e3, kind="strand", bending_stiffness_factor=0.5
)
SPRINGS = ("log10_k1", "log10_k2", "log10_k3", "log10_k4")
MODES = 6
AddedMasses = tuple[tuple[float, float], ...]


def usual_set(model: AsMade, **values: float) -> FloatArray:
    """Return one parameter set (1, parameters) without deviations, of usual terms."""
    known = {"theta_F": 0.9, "theta_L": 1.0, "shear_share": 1.0}
    known |= dict.fromkeys(SPRINGS, 5.6) | {name: model.usual(name) for name in model.terms}
    known |= {"bending_factor": model.hanger.bending_stiffness_factor} | values
    return model.pack({name: known.get(name, 0.0) for name in model.parameter_names})[None]


def member_of(model: AsMade, theta: FloatArray, plane: int, masses: AddedMasses = ()) -> Member:
    """Return the same bar for the independent elements, without sag."""
    hanger, shears = model.hanger, model.name == "beam3"
    at = dict(zip(model.parameter_names, theta[0], strict=True))
    length = hanger.length_m
    factor, heavier = (at.get(name, 1.0) for name in (FITTING_STIFFNESS[plane], "fitting_mass"))
    deck, arch = model.fittings_m
    zones = [Zone(0.0, deck, factor, heavier)] if deck else []
    for each in hanger.turnbuckles:
        stiff = at["turnbuckle_stiffness"] * each.bending_stiffness_n_m2
        mass = at["turnbuckle_mass"] * each.mass_kg / each.length_m
        zones.append(
            Zone(
                each.x_m - each.length_m / 2,
                each.x_m + each.length_m / 2,
                stiff / hanger.bending_stiffness_n_m2,
                mass / hanger.mass_per_length_kg_m,
            )
        )
    zones += [Zone(length - arch, length, factor, heavier)] if arch else []
    springs = [10 ** at.get(f"log10_k{1 + plane + 2 * end}", math.inf) for end in (0, 1)]
    lean = math.radians(90 - at.get("inclination", 90.0))
    return Member(
        length_m=length,
        tension_n=at["theta_F"] * hanger.nominal_tension_n,
        bending_stiffness_n_m2=hanger.bending_stiffness_n_m2,
        mass_per_length_kg_m=hanger.mass_per_length_kg_m,
        shear_stiffness_n=hanger.shear_stiffness_n if shears else math.inf,
        rotary_inertia_kg_m=(
            hanger.mass_per_length_kg_m * hanger.second_moment_m4 / hanger.area_m2 if shears else 0
        ),
        zones=tuple(zones),
        masses=masses,
        rotation_n_m_rad=(springs[0], springs[1]),
        gravity_along_m_s2=GRAVITY_M_S2 * math.cos(lean),
    )


@pytest.mark.parametrize("name", ["beam1", "beam2", "beam3"])
@pytest.mark.parametrize("hanger", [ROD, TUBE, STRAND], ids=["rod", "tube", "strand"])
def test_fittings_that_vanish_leave_the_closed_form(name: str, hanger: Hanger) -> None:
    """Make fittings a hair long, or as stiff and heavy as the bar, which weighs little."""
    light = replace(hanger, mass_per_length_kg_m=1e-4 * hanger.mass_per_length_kg_m)
    plain = described(name, light)
    known = {"theta_F": 0.9, "theta_L": 1.0} | dict.fromkeys(SPRINGS, 5.6)
    theta = plain.pack({each: known[each] for each in plain.parameter_names})[None]
    expected = plain.frequencies_hz(theta, MODES)
    long = as_made(name, replace(light, fittings_m=(0.04 * light.length_m, 0.02 * light.length_m)))
    units = dict.fromkeys((*FITTING_STIFFNESS, "fitting_mass"), 1.0)
    found = long.frequencies_hz(usual_set(long, inclination=90.0, **units), MODES)
    np.testing.assert_allclose(found, expected, rtol=3e-5)
    short = as_made(name, replace(light, fittings_m=(1e-5, 1e-5)))
    assert short.stiff_ends_m == (0.0, 0.0)
    found = short.frequencies_hz(usual_set(short, inclination=90.0), MODES)
    np.testing.assert_allclose(found, expected, rtol=4e-5)


SLEEVE = Turnbuckle(1.2, 0.5, 20.0, 9e5)
DESCRIBED: dict[str, tuple[str, Hanger, dict[str, float]]] = {
    "rod": ("beam2", replace(ROD, fittings_m=(0.3, 0.2)), {"fitting_stiffness_transverse": 6.0}),
    "clamped": ("beam1", replace(ROD, fittings_m=(0.3, 0.2)), {}),
    "strand": ("beam2", replace(STRAND, fittings_m=(0.5, 0.6)), {"fitting_mass": 4.0}),
    "turnbuckle": (
        "beam2",
        replace(ROD, turnbuckles=(Turnbuckle(1.2, 0.5, 25.0, 9e5),)),
        {"turnbuckle_stiffness": 0.7, "turnbuckle_mass": 1.2},
    ),
    "inclined": ("beam2", replace(ROD, inclination_deg=60.0, fittings_m=(0.3, 0.3)), {}),
    "slack": ("beam2", replace(ROD, inclination_deg=90.0), {"theta_F": 0.05}),
    # Agree within 1e-3, where shear takes up to 1 %: a sleeve shears as the bar does, a fitting's
    # shear stiffness follows its mass in the elements alone.
    "sheared turnbuckle": ("beam3", replace(ROD, turnbuckles=(SLEEVE,)), {}),
    "sheared turnbuckle of a tube": ("beam3", replace(TUBE, turnbuckles=(SLEEVE,)), {}),
    "sheared fittings": ("beam3", replace(TUBE, fittings_m=(0.3, 0.3)), {}),
}


@pytest.mark.parametrize("case", DESCRIBED)
def test_terms_have_the_frequencies_of_finite_elements(case: str) -> None:
    """Agree within 1e-4 in the plane without sag, with the tension's gradient."""
    name, hanger, values = DESCRIBED[case]
    model = as_made(name, hanger)
    theta = usual_set(model, **values)
    expected = natural_frequencies_hz(member_of(model, theta, 0), MODES, 24)
    within = 1e-3 if name == "beam3" else 1e-4
    np.testing.assert_allclose(model.frequencies_hz(theta, MODES)[0, 0], expected, rtol=within)


@pytest.mark.parametrize("case", ["rod", "turnbuckle"])
def test_a_known_mass_on_a_bar_with_terms_weighs_as_in_finite_elements(case: str) -> None:
    name, hanger, values = DESCRIBED[case]
    model = as_made(name, hanger)
    theta, mass = usual_set(model, **values), AddedMass(20.0, 3.1, 0.0)
    found = model.frequencies_at(theta, MODES, Conditions(added_mass=mass))[0, 0]
    member = member_of(model, theta, 0, ((3.1, 20.0),))
    np.testing.assert_allclose(found, natural_frequencies_hz(member, MODES, 24), rtol=1e-4)
    assert np.abs(found / model.frequencies_hz(theta, MODES)[0, 0] - 1).max() > 0.01


@pytest.mark.parametrize("bar", [ROD, TUBE], ids=["rod", "tube"])
def test_a_bar_that_shears_has_its_frequencies_whatever_its_section(bar: Hanger) -> None:
    """Vary the section as its tolerance does: rotary inertia varies with it."""
    hanger = replace(bar, fittings_m=(0.3, 0.3))
    model = as_made("beam3", hanger)
    sections = hanger.scatter.section * np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    theta = np.vstack([usual_set(model, section=each) for each in sections])
    exact = solve(model.physical(theta), MODES, np.empty(0), shapes=False).frequency_hz
    np.testing.assert_allclose(model.frequencies_hz(theta, MODES), exact, rtol=1e-5)


@pytest.mark.parametrize("lambda_squared", [2.0, 40.0])
def test_a_cable_that_sags_has_the_first_mode_of_irvine(lambda_squared: float) -> None:
    """Solve tan(x/2) = x/2 - 4/lambda2 (x/2)3 (Irvine and Caughey 1974), of sag_shape 1."""
    leaning = replace(STRAND, inclination_deg=30.0, bending_stiffness_factor=0.3)
    leaning = replace(leaning, second_moment_m4=1e-11)
    model = as_made("beam2", leaning)
    across_n = (
        leaning.mass_per_length_kg_m
        * leaning.length_m
        * GRAVITY_M_S2
        * math.cos(math.radians(30.0))
    )
    axial_n = leaning.elastic_modulus_pa * leaning.area_m2
    tension_n = (across_n**2 * axial_n / lambda_squared) ** (1 / 3)
    values = {"sag_shape": 1.0, "sag_stiffness": 1.0, "inclination": 30.0}
    theta = usual_set(model, theta_F=tension_n / leaning.nominal_tension_n, **values)
    found = model.frequencies_hz(theta, 4)[0]

    def fault(half: float) -> float:
        return float(np.sin(half) - np.cos(half) * (half - 4 / lambda_squared * half**3))

    x = 2 * brentq(fault, np.pi / 2 + 1e-9, 3 * np.pi / 2 - 1e-9)
    unit_hz = math.sqrt(tension_n / leaning.mass_per_length_kg_m) / leaning.length_m / 2 / math.pi
    nearest = found[1][np.abs(found[1] / unit_hz - x).argmin()] / unit_hz
    assert nearest == pytest.approx(x, rel=5e-3)  # bending and the tension's gradient
    assert found[0, 0] / unit_hz == pytest.approx(np.pi, rel=5e-3)


def test_sag_that_bending_holds_up_is_that_of_finite_elements() -> None:
    """Raise the first mode of a slack, leaning rod by a tenth in the plane of its weight."""
    model = as_made("beam2", replace(ROD, inclination_deg=60.0))
    values = {"sag_shape": 0.0, "sag_stiffness": 1.0, "theta_F": 0.06, "inclination": 60.0}
    theta = usual_set(model, **values, **dict.fromkeys(SPRINGS, 4.5))
    member = replace(
        member_of(model, theta, 1),
        axial_stiffness_n=ROD.elastic_modulus_pa * ROD.area_m2,
        gravity_across_m_s2=GRAVITY_M_S2 * math.sin(math.radians(30.0)),
    )
    found = model.frequencies_hz(theta, 3)[0]
    expected = natural_frequencies_hz(member, 3, 24)
    assert expected[0] > 1.1 * found[0, 0]
    np.testing.assert_allclose(found[1], expected, rtol=0.03)


def test_a_vertical_bar_has_the_same_frequencies_in_both_planes() -> None:
    model = as_made("beam2", replace(ROD, inclination_deg=90.0, fittings_m=(0.3, 0.3)))
    vertical = model.frequencies_hz(usual_set(model, inclination=90.0), MODES)[0]
    np.testing.assert_allclose(vertical[0], vertical[1], rtol=1e-9)
    leaning = model.frequencies_hz(usual_set(model, inclination=45.0, theta_F=0.3), MODES)[0]
    assert leaning[1, 0] > 1.001 * leaning[0, 0]


# ------------------------------------------------ the terms' priors


def every_term() -> list[Term]:
    """Return each kind of term: fittings by kind of end, turnbuckles, lean stated and not."""
    kinds = ("socket", "welded", "plate", "threaded", "fork", "")
    found = [term for kind in kinds for term in terms_of(replace(ROD, ends=kind), (0.3, 0.3))]
    coupled = replace(ROD, turnbuckles=(Turnbuckle(1.2, 0.5, 25.0, 9e5),))
    for degrees in (90.0, 88.0, 60.0, 20.0, math.nan):
        found += terms_of(replace(coupled, inclination_deg=degrees), (0.0, 0.0))
    return found


@pytest.mark.parametrize("term", every_term(), ids=lambda term: term.name)
def test_each_term_inverts_its_scores_within_its_bounds(term: Term) -> None:
    z = np.linspace(-3, 3, 61)
    values = term.value(z)
    low, high = term.bounds
    assert np.all((values >= low) & (values <= high))
    free = (values > low) & (values < high)
    assert free.mean() > 0.5
    np.testing.assert_allclose(term.score(values)[free], z[free], atol=1e-4)
    steps = np.diff(values)
    assert np.all(steps >= 0) or np.all(steps <= 0)


def test_the_inclination_is_as_uncertain_as_it_is_stated() -> None:
    z = np.random.default_rng(1).standard_normal(20_000)

    def lean(degrees: float) -> FloatArray:
        hanger = replace(ROD, inclination_deg=degrees)
        (term,) = (each for each in terms_of(hanger, (0, 0)) if each.name == "inclination")
        return 90 - term.value(z)

    assert np.median(lean(math.nan)) == pytest.approx(4.0, rel=0.05)
    assert np.mean(lean(math.nan) > 16) == pytest.approx(1 / 16, abs=0.01)
    assert lean(60.0).mean() == pytest.approx(30, abs=0.1)
    assert lean(60.0).std() == pytest.approx(1, rel=0.05)
    assert np.median(lean(90.0)) < 1
    assert lean(math.nan).min() >= 0


# ------------------------------------------------ slopes


def test_slopes_by_eigenvectors_are_those_of_differences(monkeypatch: pytest.MonkeyPatch) -> None:
    hanger = replace(ROD, fittings_m=(0.3, 0.2), turnbuckles=(Turnbuckle(4.0, 0.5, 25.0, 9e5),))
    model = as_made("beam2", replace(hanger, inclination_deg=70.0))
    exact = model.frequencies_hz(usual_set(model), MODES)[0]
    modes = tuple(
        Mode(plane, order + 1, float(exact[row, order]), 1e-3 * float(exact[row, order]))
        for row, plane in enumerate(PLANES)
        for order in range(MODES)
    )
    problem = Problem.of([ModalTest("t", modes, hanger=1)], model, silent)
    z = 0.5 * problem.coordinates.draw_prior(8, np.random.default_rng(1))
    exact_slopes = problem.slopes(z)
    monkeypatch.setattr(Problem, "_has_slopes", property(lambda self: False))
    np.testing.assert_allclose(problem.slopes(z), exact_slopes, atol=20 * DIFFERENCE)
    some = np.eye(problem.dimension)[:, :3]
    np.testing.assert_allclose(problem.slopes(z, some), exact_slopes[..., :3], atol=20 * DIFFERENCE)


# ------------------------------------------------ keys of the hanger's TOML

TOML = """
[[hanger]]
id = 1
length_m = 9.0
diameter_m = 0.06
elastic_modulus_pa = 205e9
density_kg_m3 = 7850
nominal_tension_n = 180e3
"""


@pytest.fixture
def written(tmp_path: Path) -> Callable[[str], Path]:
    def write(lines: str) -> Path:
        path = tmp_path / "hanger.toml"
        path.write_text(TOML + lines)
        return path

    return write


def test_ends_and_inclination_are_read(written: Callable[[str], Path]) -> None:
    hanger = load_hanger(written('ends = "fork"\ninclination_deg = 62.5\n'))
    assert (hanger.ends, hanger.end_kind, hanger.inclination_deg) == ("fork", "fork", 62.5)
    plain = load_hanger(written(""))
    assert (plain.ends, plain.end_kind) == ("", "unstated")
    assert math.isnan(plain.inclination_deg)
    assert "sag_stiffness" in as_made("beam2", hanger).bounds
    assert "sag_stiffness" not in as_made("beam2", plain).bounds


@pytest.mark.parametrize(
    ("lines", "message", "remedy"),
    [
        ('ends = "forks"', r"hanger\.toml.*ends.*forks", '"fork"'),
        ("ends = 3", r"hanger\.toml.*ends", '"socket"'),
        ("inclination_deg = 5", r"hanger\.toml.*inclination_deg.*10 and 90", "vertical"),
        ("inclination_deg = 120", r"hanger\.toml.*inclination_deg", "from the horizontal"),
        ('inclination_deg = "steep"', r"hanger\.toml.*inclination_deg", "from the horizontal"),
        ("inclination = 60", r"hanger\.toml.*inclination", "inclination_deg"),
        ('end = "fork"', r"hanger\.toml.*end", "ends"),
    ],
)
def test_a_bad_value_or_an_unknown_word_is_refused(
    written: Callable[[str], Path], lines: str, message: str, remedy: str
) -> None:
    """Name file and key in the message, and in its remedy what to write."""
    with pytest.raises(BadInput, match=message) as refused:
        load_hanger(written(lines + "\n"))
    assert remedy in f"{refused.value} {refused.value.remedy}"
