"""Frequency responses of known modes, in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import BadInput, NotIdentifiable
from shm.identify import Identification, IdentifyOptions, identify
from shm.values import FrequencyResponse, ResponsePoint

OPTIONS = IdentifyOptions(20.0, 480.0)
FREQUENCY_HZ = np.arange(8193) * (500 / 8192)
MODES = (
    (60.0, 0.002, (0.8, 1.0, -0.3)),
    (170.0, 0.001, (1.0, -0.6, -0.9)),
    (390.0, 0.0015, (0.5, -1.0, 0.9)),
)


def _accelerance(shape_index: int, added_rate: float = 0.0) -> np.ndarray:
    """Sum over modes of the transform of exp(s t); an exponential window shifts s by -1/tau."""
    omega = 2 * np.pi * FREQUENCY_HZ
    total = np.zeros(len(omega), complex)
    for frequency, damping, shape in MODES:
        natural = 2 * np.pi * frequency
        pole = -damping * natural + 1j * natural * np.sqrt(1 - damping**2)
        residue = shape[shape_index] * pole**2 / (2j * pole.imag)
        shifted = pole - added_rate
        total += residue / (1j * omega - shifted) + residue.conjugate() / (
            1j * omega - shifted.conjugate()
        )
    return total


def _response(
    index: int, added_rate: float = 0.0, coherence: float | None = None
) -> FrequencyResponse:
    return FrequencyResponse(
        source=f"point{index}.frf",
        points=(ResponsePoint(f"p{index}", None, 0.3 * (index + 1)),),
        frequency_hz=FREQUENCY_HZ,
        accelerance=_accelerance(index, added_rate)[np.newaxis],
        coherence=None if coherence is None else np.full((1, len(FREQUENCY_HZ)), coherence),
    )


def _identified(
    responses: list[FrequencyResponse], options: IdentifyOptions = OPTIONS
) -> Identification:
    return identify(responses, options, test_id="t")


def test_modes_of_a_roving_hammer_are_those_planted() -> None:
    test = _identified([_response(index) for index in range(3)]).test
    for mode, (frequency, damping, shape) in zip(test.modes, MODES, strict=True):
        assert mode.frequency_hz == pytest.approx(frequency, rel=1e-5)
        assert mode.damping_ratio == pytest.approx(damping, rel=0.01)
        largest = max(shape, key=abs)
        values = [point.value for point in mode.shape]
        assert values == pytest.approx([value / largest for value in shape], abs=0.01)


def test_all_points_in_one_response_give_the_same() -> None:
    parts = [_response(index) for index in range(3)]
    whole = replace(
        parts[0],
        points=tuple(part.points[0] for part in parts),
        accelerance=np.vstack([part.accelerance for part in parts]),
    )
    for one, other in zip(
        _identified([whole]).test.modes, _identified(parts).test.modes, strict=True
    ):
        assert one.frequency_hz == pytest.approx(other.frequency_hz, rel=1e-5)


def test_the_damping_of_an_exponential_window_is_taken_off() -> None:
    tau = 0.25
    windowed = [_response(index, 1 / tau) for index in range(3)]
    modes = _identified(windowed, replace(OPTIONS, window_time_constant_s=tau)).test.modes
    untouched = _identified(windowed).test.modes
    for mode, raw, (frequency, damping, _) in zip(modes, untouched, MODES, strict=True):
        assert mode.damping_ratio == pytest.approx(damping, rel=0.03)
        assert raw.damping_ratio == pytest.approx(
            damping + 1 / (2 * np.pi * frequency * tau), rel=0.03
        )


def test_a_point_with_unknown_lines_in_the_band_is_dropped_and_said_so() -> None:
    responses = [_response(index) for index in range(3)]
    responses[1].accelerance[0, 2000] = np.nan
    result = _identified(responses)
    assert [point.name for point in result.frequency_response.points] == ["p0", "p2"]
    assert ("point p1", 1) in [(entry.what, entry.count) for entry in result.dropped]


def test_low_coherence_is_refused_and_high_is_not() -> None:
    assert len(_identified([_response(index, 0.0, 0.98) for index in range(3)]).test.modes) == 3
    with pytest.raises(NotIdentifiable, match="the force explains 30% of the response"):
        _identified([_response(index, 0.0, 0.3) for index in range(3)])


def test_responses_of_different_lines_are_refused() -> None:
    other = replace(_response(1), frequency_hz=FREQUENCY_HZ * 1.01)
    with pytest.raises(BadInput, match="lines differ") as caught:
        _identified([_response(0), other])
    assert caught.value.file == "point1.frf"
