"""Published records: each folder's NOTE.md says what is in it and how that is known."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.optimize import brentq

from shm.errors import NotIdentifiable
from shm.identify import IdentifyOptions, identify
from shm.values import Channel, FrequencyResponse, Hanger, Recording, ResponsePoint

DATA = Path(os.environ.get("SHM_DATA", Path(__file__).parents[2] / "../shared/data")).resolve()


STRUCTURE = Hanger.without_model(1)
"""What the five hits are of, nobody knows: no bar's pattern numbers its modes."""


def _folder(name: str) -> Path:
    folder = DATA / name
    if not folder.is_dir():
        pytest.skip(f"the published records {name} are not beside the checkout (set SHM_DATA)")
    return folder


def _pyfrf_hits() -> list[Recording]:
    signals = [np.load(file) for file in sorted(_folder("pyfrf_hits").glob("*.npy"))]
    return [
        Recording(
            f"measurements_{number}",
            (Channel("force", "force", force), Channel("acc", "acceleration", acceleration)),
            25_600.0,
        )
        for number, (_, force, acceleration) in enumerate(signals, 1)
    ]


def _modelab_responses() -> list[FrequencyResponse]:
    places = (0.1, 0.25, 0.375, 0.5, 0.65, 0.8, 0.925, 1.05, 1.2)
    files = sorted(_folder("modelab_roving_beam").glob("*.txt.gz"))
    return [_signalcalc(file, x_m) for file, x_m in zip(files, places, strict=True)]


def _signalcalc(file: Path, x_m: float) -> FrequencyResponse:
    """Return a SignalCalc text export: headers, then frequency, real and imaginary part."""
    with gzip.open(file, "rt", encoding="latin1") as lines:
        rows = [line.split() for line in lines if line[:1].isdigit()]
    frequency, real, imaginary = np.array(rows, dtype=float).T
    points = (ResponsePoint(file.name, None, x_m),)
    return FrequencyResponse(file.name, points, frequency, (real + 1j * imaginary)[np.newaxis])


def _vtb(case: str) -> tuple[Recording, FrequencyResponse]:
    content = loadmat(_folder("vtb_low_coherence") / f"{case}.mat")

    def column(name: str) -> np.ndarray:
        return np.asarray(content[name]).ravel()

    channels = (
        Channel("channel 1", "force", column("Time_chan_1").astype(float)),
        Channel("channel 2", "acceleration", column("Time_chan_2").astype(float)),
    )
    response = FrequencyResponse(
        case,
        (ResponsePoint("channel 2"),),
        column("Freq_domain").astype(float),
        column("Hf_chan_2")[np.newaxis],
        column("Hf_coh_chan_2").astype(float)[np.newaxis],
    )
    return Recording(case, channels, 1280.0), response


def _free_free_shape(order: int, position: np.ndarray) -> np.ndarray:
    """Euler beam with free ends: cosh + cos - s (sinh + sin), cos(b) cosh(b) = 1."""
    middle = (order + 0.5) * np.pi
    beta = brentq(lambda b: np.cos(b) - 1 / np.cosh(b), middle - 0.1, middle + 0.1)
    s = (np.cosh(beta) - np.cos(beta)) / (np.sinh(beta) - np.sin(beta))
    b = beta * position
    return np.asarray(np.cosh(b) + np.cos(b) - s * (np.sinh(b) + np.sin(b)))


@pytest.mark.parametrize("band", [(500.0, 4500.0), (200.0, 6000.0)])
def test_five_hits_on_a_structure_give_its_published_frequencies(
    band: tuple[float, float],
) -> None:
    """810, 851, 900, 2640, 3008, 3669 Hz within 0.2 %; hardly any pre-trigger, one sensor."""
    result = identify(_pyfrf_hits(), IdentifyOptions(*band), test_id="pyfrf", hanger=STRUCTURE)
    found = np.array([mode.frequency_hz for mode in result.test.modes])
    for published in (810, 851, 900, 2640, 3008, 3669):
        assert np.min(np.abs(found / published - 1)) < 0.002, published
    assert [hit.used for hit in result.hits] == 5 * [True]
    peaks = np.array([hit.peak_force_n for hit in result.hits])
    sampled = np.array([68.6, 83.7, 85.4, 88.9, 76.5])
    assert np.all((peaks > sampled - 0.1) & (peaks < 1.02 * sampled))


def test_the_coherence_of_the_five_hits_is_as_published() -> None:
    """0.999 to 1.000 at the resonances."""
    response = identify(_pyfrf_hits(), IdentifyOptions(500, 4500), test_id="p").frequency_response
    assert response.coherence is not None
    for published in (810, 851, 900, 2640, 3008, 3669):
        line = round(published / response.frequency_hz[1])
        assert response.coherence[0, line] > 0.998


def test_a_roving_hammer_gives_the_published_frequencies_and_shapes_of_its_beam() -> None:
    """111.992, 306.855, 596.367, 974.141 Hz within 0.2 %; free-free shapes of a 1.29 m beam."""
    responses = _modelab_responses()
    modes = identify(responses, IdentifyOptions(50, 1000), test_id="beam").test.modes
    published = [111.992, 306.855, 596.367, 974.141]
    assert [mode.frequency_hz for mode in modes] == pytest.approx(published, rel=2e-4)
    assert [mode.order for mode in modes] == [1, 2, 3, 4]
    for mode in modes:
        shape = np.array([point.value for point in mode.shape])
        position = np.array([point.x_m for point in mode.shape]) / 1.29
        expected = _free_free_shape(mode.order, position)
        likeness = (shape @ expected) ** 2 / (shape @ shape) / (expected @ expected)
        assert likeness > 0.95, mode.order


def test_a_machine_at_work_is_not_a_hammer_test() -> None:
    """case2: a tone at 192.6 Hz, no hit, median coherence 0.32: refused in time and frequency."""
    recording, response = _vtb("case2")
    with pytest.raises(NotIdentifiable, match="no hammer hit"):
        identify([recording], IdentifyOptions(5, 500), test_id="case2")
    with pytest.raises(NotIdentifiable, match=r"the force explains 3\d% of the response"):
        identify([response], IdentifyOptions(5, 500), test_id="case2")


def test_one_hit_that_begins_with_its_record_is_used_with_a_warning() -> None:
    """case1: its peaks are 34.1, 66.9 and 212.19 Hz, its median coherence 0.31."""
    recording, response = _vtb("case1")
    result = identify([recording], IdentifyOptions(5, 230), test_id="case1")
    found = np.array([mode.frequency_hz for mode in result.test.modes])
    for known in (34.1, 66.9, 212.19):
        assert np.min(np.abs(found / known - 1)) < 0.003, known
    assert all(mode.frequency_sd_hz >= 0.00099 * mode.frequency_hz for mode in result.test.modes)
    assert {"hits", "pre-trigger"} <= {c.name for c in result.quality if c.verdict == "warning"}
    with pytest.raises(NotIdentifiable, match=r"the force explains 3\d% of the response"):
        identify([response], IdentifyOptions(5, 500), test_id="case1")
