"""Proof of the recordings' world against closed forms and direct integration."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from tests.worlds.recorded_kinds import KINDS, Plan
from tests.worlds.recorded_motion import Law, Modes, Push, Ringing, answer, coloured
from tests.worlds.recorded_structures import (
    Bar,
    bar_shapes,
    random_hanger,
    shear_frame,
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


def test_shear_frame() -> None:
    frame = shear_frame(5, 1e4, 3e6)
    j = np.arange(1, 6)
    exact = 2 * np.sqrt(300.0) * np.sin((2 * j - 1) * np.pi / 22) / (2 * np.pi)
    np.testing.assert_allclose(frame.frequency_hz, exact, rtol=1e-10)


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
