"""Two modes so near that noise mixes their shapes are told apart on axes that it leaves."""

from __future__ import annotations

import numpy as np
import pytest

from shm.identify.contract import FoundMode
from shm.identify.estimation.close_pairs import split_close_pairs
from shm.identify.estimation.poles import Candidate, Pole, PoleSet, Repeats, find_again
from shm.identify.estimation.validation import doubt, validate_candidates
from shm.identify.options import IdentifyOptions
from shm.values import ComplexArray

OPTIONS = IdentifyOptions(2.0, 50.0)
HITS, ORDERS = 6, (40, 44, 48, 52, 56)
SECONDS = 12.0
ONE, OTHER = 2 * np.pi * 20.0 * (1j - 0.001), 2 * np.pi * 20.002 * (1j - 0.001)
SHAPES = np.array([[1.0, 0.0], [0.5, 0.0], [0.0, 1.0], [0.0, 0.6]])


def _is_trusted(candidate: Candidate, repeat: Repeats) -> bool:
    return not doubt(candidate, repeat, OPTIONS)


def _models(mixing: float, alike: bool = False) -> list[list[PoleSet]]:
    """Those of all hits, then those without each: two modes, coupled by noise of that size."""
    rng = np.random.default_rng(4)
    shapes = SHAPES if not alike else SHAPES[:, [0, 0]] + 0.02 * SHAPES[:, ::-1]
    noise = [mixing * rng.standard_normal((2, 2)) for _ in range(HITS + 1)]
    for each in noise:
        # What noise does to the modes themselves is a tenth of what it couples.
        each[np.diag_indices(2)] *= 0.1
    return [[_poles(order, shapes, each) for order in ORDERS] for each in noise]


def _poles(order: int, shapes: np.ndarray, noise: np.ndarray) -> PoleSet:
    rates, vectors = np.linalg.eig(np.diag([ONE, OTHER]) + noise)
    sizes = np.abs(rates)
    mixed: ComplexArray = shapes @ vectors
    return PoleSet(order, sizes / (2 * np.pi), -rates.real / sizes, mixed)


def _candidates(sets: list[PoleSet]) -> list[Candidate]:
    found = []
    for index in range(2):
        norms = [np.linalg.norm(poles.shapes[:, index]) for poles in sets]
        track = tuple(
            Pole(
                poles.order,
                float(poles.frequency_hz[index]),
                float(poles.damping_ratio[index]),
                poles.shapes[:, index] / norm,
            )
            for poles, norm in zip(sets, norms, strict=True)
        )
        found.append(Candidate(track, track))
    return found


def _before(models: list[list[PoleSet]]) -> tuple[list[Candidate], list[Repeats]]:
    candidates = _candidates(models[0])
    return candidates, find_again(candidates, models[1:])


def _after(models: list[list[PoleSet]]) -> tuple[FoundMode, ...]:
    candidates, repeats = split_close_pairs(
        *_before(models), (models[0], models[1:]), SECONDS, _is_trusted
    )
    return validate_candidates(candidates, repeats, OPTIONS)[0]


def test_modes_mixed_by_noise_are_both_found_with_their_own_shapes() -> None:
    models = _models(mixing=0.05)
    assert any(doubt(*each, OPTIONS) for each in zip(*_before(models), strict=True))
    modes = _after(models)
    assert len(modes) == 2
    for mode in modes:
        likeness = np.abs(mode.shape @ SHAPES) / np.linalg.norm(SHAPES, axis=0)
        own = int(np.argmax(likeness))
        assert likeness[own] == pytest.approx(np.linalg.norm(mode.shape), rel=1e-3)
        assert mode.frequency_hz == pytest.approx((20.0, 20.002)[own], abs=0.002)
        assert abs(mode.frequency_hz - (20.0, 20.002)[own]) < 3 * mode.frequency_sd_hz
        assert mode.damping_ratio == pytest.approx(0.001, rel=0.2)


def test_modes_that_noise_does_not_mix_stay_as_they_are() -> None:
    models = _models(mixing=1e-5)
    candidates, repeats = _before(models)
    after, _ = split_close_pairs(candidates, repeats, (models[0], models[1:]), SECONDS, _is_trusted)
    assert after == candidates


def test_poles_of_one_shape_are_not_made_into_two_modes() -> None:
    models = _models(mixing=0.05, alike=True)
    candidates, repeats = _before(models)
    after, _ = split_close_pairs(candidates, repeats, (models[0], models[1:]), SECONDS, _is_trusted)
    assert after == candidates


def test_two_hits_prove_no_pair() -> None:
    models = _models(mixing=0.05)
    candidates = _candidates(models[0])
    repeats = find_again(candidates, models[1:3])
    after, _ = split_close_pairs(
        candidates, repeats, (models[0], models[1:3]), SECONDS, _is_trusted
    )
    assert after == candidates
