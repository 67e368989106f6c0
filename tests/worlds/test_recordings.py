"""Proof of the recordings' world against closed forms and direct integration."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from tests.worlds import recorded_chain as chain
from tests.worlds.recorded_kinds import KINDS, Plan
from tests.worlds.recorded_motion import Law, Modes, Push, Ringing, answer, band_limited, coloured
from tests.worlds.recorded_structures import (
    Bar,
    bar_shapes,
    bridge_deck,
    five_modes,
    random_hanger,
    shear_frame,
    with_close_planes,
    with_mode_at,
)
from tests.worlds.recordings import Recording, case, recorded

# Long, and true of no code of ours: with `make bench`.
pytestmark = pytest.mark.trial

Array = NDArray[np.float64]
BAR = Bar(8.0, 0.05, 2.0e5, (0.0, 0.0), timoshenko=False)
QUIET = Plan(quiet=True, hits=(1, 1), rebounds=0.0, rates_hz=(2000,), seconds=(20, 20))


def sprung_euler(bar: Bar, hz: float) -> float:
    """Zero at a frequency of the Euler-Bernoulli bar with end springs, from its four waves."""
    w2, t, ei = (2 * np.pi * hz) ** 2 * bar.mass_kg_m, bar.tension_n, bar.bending_nm2
    root = np.sqrt(t**2 + 4 * ei * w2)
    k, g = np.sqrt((root - t) / (2 * ei)), np.sqrt((root + t) / (2 * ei))
    x = np.array([0.0, bar.length_m])
    far = np.exp(-g * (bar.length_m - x))
    value = [np.sin(k * x), np.cos(k * x), np.exp(-g * x), far]
    slope = [k * np.cos(k * x), -k * np.sin(k * x), -g * np.exp(-g * x), g * far]
    bend = [-(k**2) * v for v in value[:2]] + [g**2 * v for v in value[2:]]
    deck, arch = bar.springs_nm
    rows = [[v[0] for v in value], [v[1] for v in value]]
    rows.append([ei * b[0] - deck * s[0] for b, s in zip(bend, slope, strict=True)])
    rows.append([ei * b[1] + arch * s[1] for b, s in zip(bend, slope, strict=True)])
    return float(np.linalg.det(np.array(rows)))


def pinned_timoshenko_hz(bar: Bar, n: int) -> float:
    """w = sin(n pi x/L), theta = cos: a problem of two by two, in closed form."""
    k, shear, rotary = n * np.pi / bar.length_m, bar.shear_n, bar.mass_kg_m * bar.diameter_m**2 / 16
    stiffness = np.array(
        [[(shear + bar.tension_n) * k**2, -shear * k], [-shear * k, bar.bending_nm2 * k**2 + shear]]
    )
    squared = np.linalg.eigvals(np.diag([1 / bar.mass_kg_m, 1 / rotary]) @ stiffness)
    return float(np.sqrt(np.min(squared.real)) / (2 * np.pi))


def test_pinned_bar_under_tension() -> None:
    n = np.arange(1, 17)
    stiffening = BAR.bending_nm2 * (n * np.pi / BAR.length_m) ** 2
    exact = n / (2 * BAR.length_m) * np.sqrt((BAR.tension_n + stiffening) / BAR.mass_kg_m)
    np.testing.assert_allclose(bar_shapes(BAR, 16).frequency_hz, exact, rtol=1e-7)


def test_string() -> None:
    thin = replace(BAR, length_m=40.0, diameter_m=1e-4, tension_n=2.0)
    exact = np.arange(1, 11) / 80.0 * np.sqrt(2.0 / thin.mass_kg_m)
    np.testing.assert_allclose(bar_shapes(thin, 10).frequency_hz, exact, rtol=2e-6)


def test_clamped_bar_without_tension() -> None:
    clamped = replace(BAR, tension_n=0.0, springs_nm=(1e9, 1e9))
    roots = np.array(
        [brentq(lambda b: np.cos(b) - 1 / np.cosh(b), lo, lo + 1.5) for lo in (4, 7.1, 10.3)]
    )
    exact = (roots / BAR.length_m) ** 2 * np.sqrt(BAR.bending_nm2 / BAR.mass_kg_m) / (2 * np.pi)
    np.testing.assert_allclose(bar_shapes(clamped, 3).frequency_hz, exact, rtol=1e-4)


def test_end_springs_against_the_four_waves() -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        for bar in random_hanger(rng).planes():
            bar = replace(bar, timoshenko=False)
            for hz in bar_shapes(bar, 12).frequency_hz:
                sides = [sprung_euler(bar, hz * (1 + d)) for d in (-1e-5, 1e-5)]
                assert sides[0] * sides[1] < 0


def test_pinned_timoshenko_bar() -> None:
    stout = replace(BAR, length_m=3.0, diameter_m=0.15, tension_n=2e6, timoshenko=True)
    exact = [pinned_timoshenko_hz(stout, n) for n in range(1, 13)]
    np.testing.assert_allclose(bar_shapes(stout, 12).frequency_hz, exact, rtol=1e-7)


def test_a_mass_in_the_middle_of_a_string() -> None:
    """Symmetric modes: b tan(b) = m L / M, b = k L / 2: the slope jumps by M w^2 / T."""
    thin = replace(BAR, length_m=40.0, diameter_m=0.02, tension_n=1e5)
    mass = 0.3 * thin.mass_kg_m * thin.length_m
    ratio = thin.mass_kg_m * thin.length_m / mass
    b = brentq(lambda b: b * np.tan(b) - ratio, 1e-6, np.pi / 2 - 1e-9)
    exact = b / (np.pi * thin.length_m) * np.sqrt(thin.tension_n / thin.mass_kg_m)
    loaded = bar_shapes(replace(thin, masses=((20.0, mass),)), 2).frequency_hz
    assert loaded[0] == pytest.approx(exact, rel=3e-3)  # the bar's own bending stiffens it so far
    free = bar_shapes(thin, 2).frequency_hz
    assert loaded[1] == pytest.approx(free[1], rel=1e-6)


def test_shapes_are_normalised_by_mass() -> None:
    x = np.linspace(0, BAR.length_m, 4001)
    shapes = bar_shapes(BAR, 6).at(x)
    mass = np.trapezoid(shapes[:, None] * shapes[None], x, axis=2) * BAR.mass_kg_m
    np.testing.assert_allclose(mass, np.eye(6), atol=1e-5)


def test_shear_frame() -> None:
    frame = shear_frame(5, 1e4, 3e6)
    j = np.arange(1, 6)
    exact = 2 * np.sqrt(300.0) * np.sin((2 * j - 1) * np.pi / 22) / (2 * np.pi)
    np.testing.assert_allclose(frame.frequency_hz, exact, rtol=1e-10)


def test_the_other_structures_are_as_said() -> None:
    for seed in range(20):
        hz = bridge_deck(np.random.default_rng(seed)).frequency_hz
        assert len(hz) == 6
        assert 0.004 < np.min(np.diff(hz) / hz[:-1]) < 0.021
        assert len(five_modes(np.random.default_rng(seed)).frequency_hz) == 5


def test_hangers_span_what_is_said() -> None:
    rng = np.random.default_rng(1)
    bars = [random_hanger(rng).transverse for _ in range(400)]
    for values, low, high in (
        ([b.length_m for b in bars], 3, 40),
        ([b.diameter_m for b in bars], 0.03, 0.15),
        ([b.tension_n for b in bars], 5e4, 2e6),
    ):
        assert low <= min(values) < 1.15 * low + 0.01 * high
        assert 0.9 * high < max(values) <= high


def test_close_planes_and_a_mode_on_the_hum() -> None:
    rng = np.random.default_rng(5)
    for _ in range(6):
        close = with_close_planes(random_hanger(rng), 0.003)
        first, second = (bar_shapes(b, 1).frequency_hz[0] for b in close.planes())
        assert second / first - 1 == pytest.approx(0.003, rel=0.02)
        on_hum = with_mode_at(close, 50.0)
        if on_hum is not None:
            assert np.min(np.abs(bar_shapes(on_hum.transverse, 16).frequency_hz - 50)) < 1e-6


def integrated(
    hz: float, damping: float, force: Callable[[float], float], t: Array, start: Array
) -> Array:
    """q'' of one mode by a Runge-Kutta method of order 8."""
    w = 2 * np.pi * hz

    def rate(at: float, y: Array) -> list[float]:
        return [y[1], force(at) - 2 * damping * w * y[1] - w**2 * y[0]]

    y = solve_ivp(rate, (t[0], t[-1]), start, "DOP853", t, max_step=5e-4, rtol=1e-9, atol=1e-14).y
    pushed = np.array([force(s) for s in t])
    return np.asarray(pushed - 2 * damping * w * y[1] - w**2 * y[0])


def test_hits_against_direct_integration() -> None:
    modes = Modes(np.array([7.0, 23.0]), np.array([0.004, 0.002]))
    pushes = [
        Push(0.1003, 0.004, np.array([1.0, 0.3])),
        Push(0.8, 0.002, np.array([0.5, 1.0])),
        Push(0.82, 0.003, np.array([0.2, 0.2])),
    ]
    t = np.linspace(0, 1.999, 2000)
    for k in (0, 1):

        def force(at: float, k: int = k) -> float:
            return sum(
                float(p.modal[k] * np.sin(np.pi * (at - p.at_s) / p.contact_s))
                for p in pushes
                if 0 < at - p.at_s < p.contact_s
            )

        exact = integrated(modes.frequency_hz[k], modes.damping[k], force, t, np.zeros(2))
        own = Ringing(modes, pushes).acceleration(k, 0.0, 1e-3, len(t))
        own = own + [force(s) for s in t]
        np.testing.assert_allclose(own, exact, atol=1e-6 * np.max(np.abs(exact)))


def test_a_record_that_begins_within_its_hit() -> None:
    modes = Modes(np.array([7.0]), np.array([0.004]))
    pushes = [Push(-0.0021, 0.004, np.array([1.0]))]
    longer = Ringing(modes, pushes).eta(0, -0.1, 1e-3, 400)
    shorter = Ringing(modes, pushes).eta(0, 0.0, 1e-3, 300)
    np.testing.assert_allclose(shorter[2:], longer[102:], rtol=1e-9)


def test_a_release_starts_at_the_static_pull() -> None:
    modes = Modes(np.array([5.0]), np.array([0.01]))
    t = np.linspace(0, 0.999, 1000)
    pulled = 3.0 / (2 * np.pi * 5.0) ** 2
    exact = integrated(5.0, 0.01, lambda at: 0.0, t, np.array([pulled, 0.0]))
    own = Ringing(modes, [Push(0.0, 0.0, np.array([3.0]))]).acceleration(0, 0.0, 1e-3, 1000)
    np.testing.assert_allclose(own, exact, atol=1e-6 * np.max(np.abs(exact)))


@pytest.mark.parametrize(("change", "power"), [(-2e-3, 1), (2e-3, 2)])
def test_amplitude_moves_the_phase_as_the_averaged_equation(change: float, power: int) -> None:
    modes = Modes(np.array([6.0]), np.array([0.003]))
    pushes = [Push(0.0, 1e-3, np.array([1.0])), Push(3.0, 1e-3, np.array([0.6]))]
    law = Law(np.array([change]), power)
    ringing = Ringing(modes, pushes, law)
    eta = ringing.eta(0, 0.0, 1e-3, 8000)
    w = abs(modes.poles[0].imag)

    def rate(at: float, y: Array) -> Array:
        bent = change * (abs(y[0]) / ringing.reference[0]) ** power
        return np.array([(modes.poles[0] + 1j * w * bent) * y[0]])

    for begin, end in ((2, 3000), (3002, 8000)):
        t = np.arange(begin, end) * 1e-3
        free = solve_ivp(rate, (t[0], t[-1]), [eta[begin]], "DOP853", t, rtol=1e-10, atol=1e-18)
        np.testing.assert_allclose(eta[begin:end], free.y[0], rtol=1e-5)
    size = np.abs(eta[2:])
    bent = change * (size / ringing.reference[0]) ** power
    mean = 6.0 * (1 + np.sum(bent * size**2) / np.sum(size**2))
    assert ringing.mean_frequency_hz(0, 8.0) == pytest.approx(mean, rel=1e-7)


def test_a_short_contact_keeps_its_impulse() -> None:
    for at_s in (0.1, 0.10013, 0.1002):
        push = Push(at_s, 4e-4, np.zeros(0))
        _, pulse = band_limited(push, 0.0, 1 / 4000, 4000)
        assert np.sum(pulse) / 4000 == pytest.approx(2 / np.pi * 4e-4, rel=2e-3)


def test_noise_has_its_density_and_a_mode_under_it_its_variance() -> None:
    """Under white force S the displacement has the variance S w / (8 z w^4) (one-sided, per Hz)."""
    rng, count, step = np.random.default_rng(0), 400_000, 5e-3
    force = coloured(rng, count, step, np.full(count // 2 + 1, 0.3))
    assert np.var(force) == pytest.approx(0.3**2 / (2 * step), rel=0.02)
    modes, w = Modes(np.array([8.0]), np.array([0.01])), 2 * np.pi * 8.0
    displacement = np.fft.rfft(answer(modes, 0, force, step))[1:]
    displacement /= -((2 * np.pi * np.fft.rfftfreq(count, step)[1:]) ** 2)
    variance = 2 * np.sum(np.abs(displacement) ** 2) / count**2
    assert variance == pytest.approx(0.3**2 / (8 * 0.01 * w**3), rel=0.1)


def test_density_of_known_noise() -> None:
    rng = np.random.default_rng(0)
    trace = 0.5 * rng.standard_normal(50_000) + 3.0
    found = chain.density(trace, 500.0).around(100.0, 40.0)
    assert found == pytest.approx(0.25 / 250.0, rel=0.06)


def test_filters() -> None:
    logger = chain.Logger(1000.0, 0.0, 0.0, "steep", 24, 50.0, 4)
    steep = np.abs(chain.filter_gain(logger, np.array([10.0, 390.0, 500.0, 900.0])))
    np.testing.assert_allclose(steep, [1, 1, 0, 0], atol=1e-12)
    analogue = replace(logger, filter="butterworth")
    at = np.abs(chain.filter_gain(analogue, np.array([1.0, 400.0, 800.0])))
    np.testing.assert_allclose(at, [1, np.sqrt(0.5), 1 / np.sqrt(1 + 2**16)], rtol=1e-6)


def test_the_chain_delays_shakes_and_rounds() -> None:
    logger = chain.Logger(1000.0, 0.0, 0.0, "steep", 16, 50.0, 4)
    wire = chain.Wire((1.0, 0.0), 1e-3, 0.0, 1.0, 0.0, 0.0, 0.0, 10.0)
    t = np.arange(8000) / 4000
    tone = np.sin(2 * np.pi * 20 * t)
    jitter = np.full(2000, 1e-5)
    seen = chain.sampled(logger, wire, tone, jitter)
    exact = np.sin(2 * np.pi * 20 * (t[::4] - 1e-3 + 1e-5))
    np.testing.assert_allclose(seen, exact, atol=2e-6)
    rounded = chain.converted(logger, wire, seen * 12)
    assert np.max(rounded) == 10.0 - chain.lsb(logger, wire)
    inside = np.abs(seen * 12) < 9.9
    assert np.max(np.abs(rounded - seen * 12)[inside]) <= chain.lsb(logger, wire) / 2 * 1.0001


def quiet(seed: int, **changes: object) -> Recording:
    plan = replace(QUIET, **changes)  # type: ignore[arg-type]
    return recorded(np.random.default_rng(seed), plan, "quiet", seed)


def test_a_quiet_record_is_the_sum_of_its_modes() -> None:
    """Least squares of the true modes leaves nothing of the ring-down."""
    for seed in (1, 2, 3):
        record = quiet(seed)
        hit = record.truth.hits[0]
        begin = int((hit.time_s + hit.contact_s) * record.rate_hz) + 40
        t = record.time_s[begin:-80] - record.time_s[begin]
        y = record.data[begin:-80, 1]
        rows = []
        for mode in record.truth.modes:
            w = 2 * np.pi * mode.frequency_hz
            fade = np.exp(-mode.damping_ratio * w * t)
            turn = w * np.sqrt(1 - mode.damping_ratio**2) * t
            rows += [fade * np.cos(turn), fade * np.sin(turn)]
        basis = np.array(rows).T
        rest = y - basis @ np.linalg.lstsq(basis, y)[0]
        assert np.sum(rest**2) < 1e-4 * np.sum(y**2)


def test_the_force_over_the_response_is_the_accelerance() -> None:
    """sum phi phi (-w^2) / (w_k^2 - w^2 + 2 i z w_k w) at the peaks, from one hit in line."""
    record = quiet(4, seconds=(59, 60))
    force, response = (np.fft.rfft(record.data[:, i], 1 << 18) for i in (0, 1))
    frequency = np.fft.rfftfreq(1 << 18, 1 / record.rate_hz)
    hit = record.truth.hits[0]
    along = np.cos(np.deg2rad(hit.off_plane_deg))
    across = np.sin(np.deg2rad(hit.off_plane_deg))
    share = {hit.plane: along}
    share.setdefault("transverse", across)
    share.setdefault("longitudinal", across)
    mode = next(m for m in record.truth.modes if m.plane == "transverse")
    bar = Bar(
        record.truth.description["length_m"],
        record.truth.description["diameter_m"],
        record.truth.description["tension_n"],
        (
            record.truth.description["deck_transverse_nm_per_rad"],
            record.truth.description["arch_transverse_nm_per_rad"],
        ),
    )
    at_hit = bar_shapes(bar, 16).at([hit.place_m])[:, 0]
    w = 2 * np.pi * frequency
    total = np.zeros(len(w), complex)
    for m in record.truth.modes:
        own = 2 * np.pi * m.frequency_hz
        if m.plane == "transverse":
            receptance = m.shape[0] * at_hit[m.order - 1] * share["transverse"]
            total += receptance * -(w**2) / (own**2 - w**2 + 2j * m.damping_ratio * own * w)
    left = np.exp(-mode.damping_ratio * 2 * np.pi * mode.frequency_hz * record.time_s[-1])
    peak = int(np.argmin(np.abs(frequency - mode.frequency_hz)))
    assert abs(response[peak] / force[peak] / total[peak] - 1) < 0.02 + 2 * left


def test_energy_of_a_ring_down_in_closed_form() -> None:
    """a^2 / (4 z w), a the amplitude of q'': what the truth's ratio of energies begins with."""
    modes = Modes(np.array([9.0]), np.array([0.005]))
    push = Push(0.0, 1e-4, np.array([1.0]))
    own = Ringing(modes, [push]).acceleration(0, 1e-4, 1e-3, 60_000)
    w = 2 * np.pi * 9.0
    amplitude = w * 2 / np.pi * 1e-4  # the impulse is the velocity
    assert np.sum(own**2) * 1e-3 == pytest.approx(amplitude**2 / (4 * 0.005 * w), rel=0.02)


def test_ten_times_the_noise_costs_twenty_decibels() -> None:
    plan = KINDS["single_hit"].plan
    plain, louder = (
        recorded(np.random.default_rng(8), replace(plan, noise=noise), "", 0).truth.modes
        for noise in (1000.0, 10_000.0)
    )
    drop = [a.snr_db - b.snr_db for a, b in zip(plain, louder, strict=True)]
    assert np.median(drop) == pytest.approx(20.0, abs=1.0)


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_is_the_same_each_time_and_complete(kind: str) -> None:
    record, again = case(kind, 11), case(kind, 11)
    assert np.array_equal(record.data, again.data, equal_nan=True)
    assert record.truth == again.truth
    assert not np.array_equal(record.data, case(kind, 12).data, equal_nan=True)
    assert record.data.shape[1] == len(record.channels) == len(record.truth.delays_s)
    assert 200 <= record.rate_hz <= 5000
    assert len(record.truth.modes) >= 2
    accelerations = [c for c in record.channels if c.quantity == "acceleration"]
    for mode in record.truth.modes:
        assert 0.0005 <= mode.damping_ratio <= 0.01
        assert len(mode.shape) == len(accelerations)
    assert all(c.unit in ("N", "m/s2", "g") for c in record.channels)
    assert len(set(record.names)) == len(record.names)
    assert KINDS[kind].reason


def test_hits_are_where_the_force_says() -> None:
    for seed in range(4):
        record = case("plain", seed)
        for hit in record.truth.hits:
            middle = int((hit.time_s + hit.contact_s / 2) * record.rate_hz)
            near = record.data[middle - 3 : middle + 4, 0]
            assert np.max(near) > 0.2 * hit.peak_n * min(1.0, hit.contact_s * record.rate_hz)


def test_clipped_channels_stay_at_half_their_peak() -> None:
    for kind, quantity in (("clipped_force", "force"), ("clipped_acceleration", "acceleration")):
        record = case(kind, 0)
        wanted = [c.name for c in record.channels if c.quantity == quantity]
        assert list(record.truth.clipped) == wanted
        for i, channel in enumerate(record.channels):
            top = np.max(np.abs(record.data[:, i]))
            reaches = top >= 0.9999 * channel.full_scale
            assert reaches == (channel.quantity == quantity)
    assert case("plain", 0).truth.clipped == ()


def test_frequencies_move_with_amplitude_as_said() -> None:
    for kind, sign in (("softening", -1), ("hardening", 1)):
        for mode in case(kind, 2).truth.modes:
            shift = (mode.mean_frequency_hz / mode.frequency_hz - 1) * sign
            assert 0 < shift < mode.change_at_peak * sign
            assert 2e-4 <= mode.change_at_peak * sign <= 2e-3
    for mode in case("plain", 2).truth.modes:
        assert mode.mean_frequency_hz == mode.frequency_hz


def test_faults_are_where_the_truth_says() -> None:
    dead = case("dead_channel", 1)
    i = dead.names.index(dead.truth.faulty[0])
    spread = np.nanstd(dead.data, axis=0)
    assert spread[i] < 1e-3 * dead.channels[i].full_scale
    for kind in ("dropout_nan", "dropout_stuck"):
        record = case(kind, 1)
        i = record.names.index(record.truth.faulty[0])
        assert record.truth.gap_s is not None
        begin, end = (round(t * record.rate_hz) for t in record.truth.gap_s)
        gap = record.data[begin:end, i]
        assert np.all(np.isnan(gap)) if kind == "dropout_nan" else np.ptp(gap) == 0
        assert np.sum(np.isnan(record.data)) == (end - begin if kind == "dropout_nan" else 0)
    wrong = case("wrong_gain", 1)
    i = wrong.names.index(wrong.truth.faulty[0])
    top = np.max(np.abs(wrong.data[:, i] / wrong.truth.wrong_factor))
    assert top <= wrong.channels[i].full_scale
    assert wrong.truth.wrong_factor != 1


@pytest.mark.parametrize("kind", ["single_hit", "softening", "taps", "one_axis", "ambient"])
def test_a_record_shows_its_modes(kind: str) -> None:
    """The spectrum peaks at the truth, as the file's clock shows it, where a mode stands alone.

    Of hits, what follows the last: several together peak where their phases agree.
    """
    seen = 0
    for seed in range(6):
        record = case(kind, seed)
        hits = [h.time_s + h.contact_s for h in record.truth.hits]
        begin = int(max(hits, default=0.0) * record.rate_hz) + 5
        sensors = [i for i, c in enumerate(record.channels) if c.quantity == "acceleration"]
        data = record.data[begin:, sensors] - record.data[begin:, sensors].mean(axis=0)
        fade = 0.5 + 0.5 * np.cos(np.pi * np.arange(len(data)) / len(data))
        size = 1 << 18
        power = np.abs(np.fft.rfft(data * fade[:, None], size, axis=0)) ** 2
        frequency = np.fft.rfftfreq(size, 1 / record.rate_hz)
        width = record.rate_hz / len(data)
        others = [m.frequency_hz for m in record.truth.modes]
        others += [line.frequency_hz for line in record.truth.lines]
        for mode in record.truth.modes:
            hz = mode.frequency_hz / (1 + record.truth.time_base_error)
            near = max(6 * mode.damping_ratio * hz, 4 * width)
            alone = sum(abs(f - mode.frequency_hz) < 1.5 * near for f in others) == 1
            best = int(np.argmax(np.abs(mode.shape)))
            in_plane = record.channels[sensors[best]].plane == mode.plane
            if alone and in_plane and mode.snr_db > 35 and hz < 0.35 * record.rate_hz:
                band = np.flatnonzero(np.abs(frequency - hz) < near)
                peak = frequency[band[np.argmax(power[band, best])]]
                reach = 2.0 * mode.damping_ratio * hz + 2e-3 * hz * (kind == "softening")
                assert abs(peak - hz) <= max(reach, 0.5 * width)
                seen += 1
    assert seen >= 5


def test_no_mode_is_heard_in_a_dead_channel() -> None:
    for seed in range(4):
        record = case("dead_channel", seed)
        plane = record.channels[record.names.index(record.truth.faulty[0])].plane
        if len(record.channels) == 3:
            snr = [m.snr_db for m in record.truth.modes if m.plane == plane]
            rest = [m.snr_db for m in record.truth.modes if m.plane != plane]
            assert np.median(snr) < np.median(rest)


def test_what_sets_kinds_apart() -> None:
    assert all(c.quantity == "acceleration" for c in case("taps", 0).channels)
    assert all(c.quantity == "acceleration" for c in case("quick_release", 0).channels)
    assert {c.plane for c in case("one_axis", 0).channels[1:]} == {"transverse"}
    assert case("no_pre_trigger", 0).truth.hits[0].time_s < 0
    assert len([h for h in case("single_hit", 0).truth.hits if not h.rebound]) == 1
    assert any(h.rebound for h in case("double_hits", 0).truth.hits)
    for kind in ("ambient", "ambient_trucks", "any_bridge"):
        assert case(kind, 0).truth.hits == ()
    short = case("short_record", 0)
    assert 2 <= len(short.data) / short.rate_hz <= 4
    assert len(case("low_rate", 0).truth.modes) <= 14
    first = case("close_planes", 1).truth.modes
    ones = [m.bare_frequency_hz for m in first if m.order == 1]
    assert ones[1] / ones[0] - 1 == pytest.approx(0.003, rel=0.02)
    on_hum = case("hum_at_mode", 0).truth.modes
    assert min(abs(m.frequency_hz - 50) for m in on_hum if m.plane == "transverse") < 0.01
    heavy = case("heavy_sensor", 0).truth
    assert all(m.frequency_hz < m.bare_frequency_hz for m in heavy.modes if m.order == 1)
    assert case("sidebands", 0).truth.modulation_hz > 0
    doubled = [x.frequency_hz for x in case("second_harmonic", 0).truth.lines if "2 f1" in x.cause]
    ones = [m.frequency_hz for m in case("second_harmonic", 0).truth.modes if m.order == 1]
    assert doubled == pytest.approx([2 * hz for hz in ones])
    weak, plain = (
        np.median([m.snr_db for s in range(4) for m in case(kind, s).truth.modes])
        for kind in ("low_signal", "plain")
    )
    assert weak < plain - 25


def test_trucks_are_not_stationary() -> None:
    def unrest(kind: str) -> float:
        levels = []
        for seed in range(3):
            data = case(kind, seed).data[:, 0]
            spread = [np.std(block) for block in np.array_split(np.diff(data), 40)]
            levels.append(np.max(spread) / np.median(spread))
        return float(np.median(levels))

    assert unrest("ambient") < 1.6
    assert unrest("ambient_trucks") > 2.0
