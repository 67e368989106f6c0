"""The guided hammer test on a simulated device: what is said of each hit, and what is kept."""

from __future__ import annotations

import numpy as np
import pytest

from shm.acquire import Acquired, AcquireOptions, SimulatedDevice, acquire
from shm.errors import BadInput
from shm.models import THESIS, build
from shm.values import Channel, FloatArray, Hanger
from tests.helpers.slow import few_of

OPTIONS = AcquireOptions(seconds=8.0, most_hits=4)
NOTHING = np.empty(0)
CHANNELS = (
    Channel("force", "force", NOTHING, "transverse", 1.9, 5000.0),
    Channel("acc_1", "acceleration", NOTHING, "transverse", 2.52, 400.0),
    Channel("acc_2", "acceleration", NOTHING, "transverse", 4.4, 400.0),
)


@pytest.fixture
def hanger() -> Hanger:
    return Hanger(
        id=3,
        length_m=12.0,
        elastic_modulus_pa=200e9,
        area_m2=np.pi * 0.13**2 / 4,
        second_moment_m4=np.pi * 0.13**4 / 64,
        mass_per_length_kg_m=7800 * np.pi * 0.13**2 / 4,
        nominal_tension_n=711e3,
        diameter_m=0.13,
    )


def run(hanger: Hanger, said: list[str], **faults: object) -> Acquired:
    rng = np.random.default_rng(7)
    device = SimulatedDevice(hanger, CHANNELS, rng, hits=6, seconds=13.0, **faults)  # type: ignore[arg-type]
    return acquire(device, CHANNELS, said.append, OPTIONS, hanger=hanger)


@pytest.mark.parametrize("rate_hz", few_of([1000.0, 4000.0], 1))
def test_acquire_stops_when_good(hanger: Hanger, rate_hz: float) -> None:
    said: list[str] = []

    got = run(hanger, said, sampling_rate_hz=rate_hz)

    assert (len(got.hits), got.rejected, got.missing, got.lost) == (3, (), "", "")
    assert said[-1] == "Enough."
    assert {each.sampling_rate_hz for each in got.hits} == {1000.0}
    assert got.found is not None
    model = build("beam1", hanger, THESIS)
    truth = model.frequencies_hz(np.ones((1, len(model.parameter_names))), 8)[0, 0]
    modes = got.found.test.modes
    assert [mode.order for mode in modes] == list(range(1, len(modes) + 1))
    assert len(modes) >= 5
    for mode in modes:
        assert mode.frequency_hz == pytest.approx(truth[mode.order - 1], rel=1e-3)


def test_acquire_rejects_at_once(hanger: Hanger) -> None:
    said: list[str] = []

    got = run(hanger, said, double=(2,), overload=(3,))

    assert [each.split(":")[0] for each in got.rejected] == [
        "Double hit",
        "Overload of force",
    ]
    at = next(n for n, text in enumerate(said) if text.startswith("Double hit"))
    assert said[at - 1] == said[at + 1] == "Hit 2: hit now."
    assert len(got.hits) == 3
    assert not got.missing
    for hit in got.hits:
        assert all(np.abs(each.values).max() < each.full_scale for each in hit.channels)


def test_acquire_device_lost_keeps_hits(hanger: Hanger) -> None:
    said: list[str] = []

    got = run(hanger, said, lost_s=13.0 + 4.1 + 5.0)  # five seconds after the second hit

    assert "has gone" in got.lost
    assert len(got.hits) == 2
    assert said[-1].startswith("Hit 2 is cut short")
    whole, cut = got.hits
    assert whole.duration_s > cut.duration_s > 5.0
    assert cut.force is not None
    assert np.abs(cut.force.values).max() > 500.0


def test_acquire_lost_before_hit(hanger: Hanger) -> None:
    got = run(hanger, [], lost_s=3.0)

    assert got.hits == ()
    assert got.missing == "no hit yet"
    assert got.lost


def test_acquire_not_good_says_why(hanger: Hanger) -> None:
    rng = np.random.default_rng(7)
    device = SimulatedDevice(hanger, CHANNELS, rng, hits=3, seconds=13.0)
    options = AcquireOptions(seconds=8.0, least_hits=2, most_hits=2, precision=1e-9)

    got = acquire(device, CHANNELS, list[str]().append, options, hanger=hanger)

    assert len(got.hits) == 2
    assert "is known to" in got.missing


class Dead:
    """An interface whose last channel gives nothing, or whose first is at its limit."""

    def __init__(self, dead: bool) -> None:
        self.sampling_rate_hz, self._dead = 8000.0, dead
        self._rng = np.random.default_rng(1)

    def read(self, samples: int) -> FloatArray:
        block = 1e-4 * self._rng.normal(size=(len(CHANNELS), samples))
        block[-1 if self._dead else 0] = 0.0 if self._dead else 1.0
        return block

    def close(self) -> None:
        """Close nothing."""


@pytest.mark.parametrize(("dead", "wrong"), [(True, "acc_2 is dead"), (False, "Overload of force")])
def test_acquire_refuses_bad_levels(dead: bool, wrong: str) -> None:
    with pytest.raises(BadInput, match=wrong) as refused:
        acquire(Dead(dead), CHANNELS, list[str]().append, OPTIONS)

    assert "cable" in refused.value.remedy


class Interrupted(SimulatedDevice):
    """A device at which the crew presses Ctrl-C after so many seconds."""

    read_s = 0.0

    def read(self, samples: int) -> FloatArray:
        self.read_s += samples / self.sampling_rate_hz
        if self.read_s > 25.0:
            raise KeyboardInterrupt
        return super().read(samples)


def test_acquire_interrupted_keeps_hits(hanger: Hanger) -> None:
    device = Interrupted(hanger, CHANNELS, np.random.default_rng(7), hits=3, seconds=13.0)

    got = acquire(device, CHANNELS, list[str]().append, OPTIONS, hanger=hanger)

    assert len(got.hits) == 1
    assert not got.lost
