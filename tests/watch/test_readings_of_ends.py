"""What one test says of springs that are clamped, that come loose, or of which one moves alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.values import Turnbuckle
from shm.watch.quantities import coordinate_of, shift_of
from shm.watch.readings import Reader
from tests.helpers.hangers import HANGER_3
from tests.helpers.modelled_tests import WHEN, common_of, frequencies, measured, posterior

SPRUNG = (1.1, 0.97, 7.0, 7.6, 8.6, 6.4)


def test_a_clamped_end_is_hardly_seen_and_spoils_nothing() -> None:
    theta = (1.1, 0.97, 11.8, 11.9, 11.7, 11.8)
    frequency_hz = frequencies(theta)
    clamped = Reader(posterior(theta), [measured(frequency_hz)], HANGER_3)
    now = frequencies((0.95 * theta[0], *theta[1:]))
    reading = clamped.reading(measured(now, rng=np.random.default_rng(1)), WHEN)
    steps = np.array([each.step_sd for each in clamped.quantities])
    told = np.diag(reading.information) * steps**2
    assert told[0] > 100
    assert np.all(told[1:] < 0.01)
    tension_sd = reading.information[0, 0] ** -0.5
    assert reading.mean[0] == pytest.approx(np.log(0.95), abs=4 * tension_sd)


def test_ends_that_were_nearly_clamped_are_seen_to_come_loose() -> None:
    theta = (1.1, 0.97, 9.5, 9.2, 9.5, 10.2)
    nearly = Reader(posterior(theta), [measured(frequencies(theta))], HANGER_3)
    loose = (*theta[:2], 7.0, theta[3], 7.0, theta[5])
    reading = nearly.reading(measured(frequencies(loose)), WHEN)
    expected = coordinate_of(nearly.quantities[1], 7.0)
    assert reading.mean[1] == pytest.approx(expected, rel=0.02)
    assert reading.mean[0] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("mover", [2, 4])
@pytest.mark.parametrize(
    ("deck", "arch", "tension_off"),
    # Of unlike ends a part of the change looks like tension: about one sd of such a test.
    [(7.0, 7.0, 0.002), (8.0, 8.0, 0.0002), (7.0, 8.0, 0.0035), (8.0, 7.0, 0.0035)],
)
def test_a_loss_of_one_end_is_read_as_a_loss_of_the_ends_of_its_plane(
    deck: float, arch: float, tension_off: float, mover: int
) -> None:
    before = [1.1, 0.97, deck, 7.6, arch, 6.4]
    after = before.copy()
    after[mover] += np.log10(0.7)
    one = Reader(posterior(before), [measured(frequencies(before))], HANGER_3)
    reading = one.reading(measured(frequencies(after)), WHEN)
    tension, transverse, longitudinal = (
        shift_of(each, float(x)) for each, x in zip(one.quantities, reading.mean, strict=True)
    )
    true = common_of(after[2::2]) - common_of(before[2::2])
    assert one.quantities[1].plane == "transverse"
    assert transverse == pytest.approx(true, abs=0.02)
    assert transverse < -0.015
    assert abs(longitudinal) < 0.01
    assert abs(tension) < tension_off


def test_ends_that_a_turnbuckle_tells_apart_are_read_apart() -> None:
    hanger = replace(HANGER_3, turnbuckles=(Turnbuckle(1.5, 0.6, 120.0, 6e6),))
    known = frequencies(SPRUNG, hanger=hanger)
    apart = Reader(posterior(SPRUNG, hanger=hanger), [measured(known)], hanger)
    loosened = [*SPRUNG[:4], SPRUNG[4] - 0.5, SPRUNG[5]]
    reading = apart.reading(measured(frequencies(loosened, hanger=hanger)), WHEN)
    shifts = [
        shift_of(each, float(x)) for each, x in zip(apart.quantities, reading.mean, strict=True)
    ]
    names = [each.name for each in apart.quantities]
    assert shifts[names.index("log10_k3")] == pytest.approx(-0.5, abs=0.02)
    assert shifts[names.index("log10_k1")] == pytest.approx(0.0, abs=0.02)
    assert shifts[0] == pytest.approx(0.0, abs=1e-3)
