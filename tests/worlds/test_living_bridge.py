"""The living bridge against closed forms, and its records against its own truth."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy.signal import welch

from tests.worlds.living_bridge import (
    PLANES,
    RATE_HZ,
    Change,
    Flags,
    HourlyFlags,
    describe,
    hourly,
    hourly_arrays,
    raw,
    true_tension,
    truth,
)

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product

START = datetime(2026, 5, 4, 9, tzinfo=UTC)
QUIET = HourlyFlags(**{n: False for n in HourlyFlags.__dataclass_fields__ if n != "scatter"})


def test_spectrum_peaks_at_the_truth() -> None:
    chunks = list(raw(3, [6], START, 0.25, flags=Flags.none()))
    assert [c["sequence"] for c in chunks] == list(range(15))
    values = np.concatenate([c["values"] for c in chunks], axis=1)
    assert values.dtype == np.float32
    f, psd = welch(values, RATE_HZ, nperseg=2**14)
    known = truth(3, [6], [START + timedelta(minutes=7)])[6]
    for row, plane in enumerate(PLANES):
        for hz in known["frequency_hz"][plane][0, :4]:
            near = np.abs(f / hz - 1) < 0.02
            spectrum = psd[row] + psd[row + 2]
            peak = f[near][np.argmax(spectrum[near])]
            assert peak == pytest.approx(hz, abs=max(2.5 * f[1], 2e-3 * hz))


def test_a_loss_lowers_the_frequencies_and_loads_the_next() -> None:
    lost = [Change("tension_loss", 5, START, 0.04)]
    times = [START - timedelta(hours=1), START + timedelta(hours=1)]
    before, after = truth(2, [4, 5, 6, 9], times), truth(2, [4, 5, 6, 9], times, lost)
    ratio = {h: after[h]["tension_n"] / before[h]["tension_n"] for h in before}
    given = 0.01 * before[5]["tension_n"][1]
    assert all(r[0] == 1 for r in ratio.values())
    assert ratio[5][1] == pytest.approx(0.96, abs=2e-3)
    assert ratio[4][1] == pytest.approx(1 + given / before[4]["tension_n"][1], abs=1e-3)
    assert ratio[9][1] == 1
    hz = after[5]["frequency_hz"]["transverse"] / before[5]["frequency_hz"]["transverse"]
    # Of a string sqrt(0.96); bending and the ends hold on to the higher ones.
    assert 0.9795 < hz[1, 0] < 0.992
    assert np.all(np.diff(hz[1, :5]) > 0)
    assert np.all(hz[0] == 1)


def test_same_seed_same_bridge() -> None:
    for one, other in zip(raw(5, [1, 2], START, 0.05), raw(5, [1, 2], START, 0.05), strict=True):
        np.testing.assert_array_equal(one.pop("values"), other.pop("values"))
        assert one == other
    assert hourly(5, 1, 0.01) == hourly(5, 1, 0.01)
    assert describe(5) == describe(5) != describe(6)
    # Stretches of one world agree where they overlap.
    day = [START + timedelta(hours=h) for h in range(48)]
    np.testing.assert_allclose(
        true_tension(5, 3, day)[30], true_tension(5, 3, day[30])[0], rtol=1e-5
    )


def test_readings_scatter_as_they_say_and_lie_where_the_truth_is() -> None:
    plain = hourly_arrays(4, 8, 0.5, flags=QUIET)
    z = (plain.frequency_hz - plain.true_hz) / plain.true_sd_hz
    assert np.nanstd(z) == pytest.approx(1, abs=0.03)
    field = hourly_arrays(4, 8, 0.5)
    relative = field.frequency_sd_hz / field.frequency_hz
    assert 2e-5 < np.nanmedian(relative) < 4e-4
    assert 0.02 < np.isnan(field.frequency_hz).all(axis=(1, 2)).mean() < 0.5
    assert np.nanmedian(np.abs(field.frequency_hz / field.true_hz - 1)) < 6e-4
    first = field.readings()[0]
    assert first["modes"][0]["frequency_sd_hz"] > 0
    assert first["time"].tzinfo is not None
