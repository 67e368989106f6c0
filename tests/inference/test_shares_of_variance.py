"""What answers ask of the owner: the share of ends and inclination in the tension; emcee."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.inference import UpdateOptions, update
from shm.inference.answer.shares_of_variance import explained_share
from shm.models import described
from shm.values import Hanger, ModalTest, Posterior, Selection
from tests.helpers.given_modes import with_modes
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import a_posterior

BAR = replace(HANGER_3, plate=None)
ENDS = "The ends decide more than half of the interval. State `ends`"
INCLINATION = "The inclination decides more than half of the interval. State `inclination_deg`"


def sprung(hanger: Hanger) -> ModalTest:
    """Return three modes a plane of a bar on springs, of which the tension depends."""
    model = described("beam2", hanger, "thesis")
    springs = {f"log10_k{end}": 7.0 for end in (1, 2, 3, 4)}
    found = model.frequencies_hz(model.pack({"theta_F": 0.93, "theta_L": 1.0, **springs})[None], 3)
    return with_modes(found[0], 2e-4)


def wide(**fields: object) -> Posterior:
    """Return a posterior with a half width of 8 % of its tension."""
    posterior = a_posterior()
    samples = posterior.samples.copy()
    samples[:, 0] = np.linspace(0.9, 1.1, len(samples))
    return replace(posterior, samples=samples, **fields)  # type: ignore[arg-type]


def asked(posterior: Posterior) -> list[str]:
    """Return the caveats that are of this page, of which none is a fault."""
    averaged = Selection((posterior,), (1.0,)).averaged
    found = [each for each in averaged.caveats if each.startswith((ENDS, INCLINATION, "Sampled"))]
    assert not set(found) & {*averaged.faults, *posterior.faults}
    return found


def test_explained_share_of_sums_differences_and_nothing() -> None:
    rng = np.random.default_rng(1)
    scores, noise = rng.standard_normal((2000, 3)), rng.standard_normal(2000)
    assert explained_share(scores.sum(axis=1) + np.sqrt(3) * noise, scores) == pytest.approx(
        0.5, abs=0.05
    )
    assert explained_share((scores[:, 0] - scores[:, 1]) ** 2, scores) == pytest.approx(1)
    assert explained_share(noise, scores) == pytest.approx(0, abs=0.02)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"ends_share_of_variance": 0.6}, [ENDS]),
        ({"ends_share_of_variance": 0.4}, []),
        ({"inclination_share_of_variance": 0.6}, [INCLINATION]),
        ({"inclination_share_of_variance": 0.4}, []),
        ({"method": "emcee", "sampler": "importance"}, ["Sampled by emcee, because importance"]),
        ({"method": "emcee", "sampler": "emcee"}, ["Sampled by emcee, because it was asked for"]),
        ({}, []),
    ],
)
def test_caveat_names_key_or_sampler(fields: dict[str, object], words: list[str]) -> None:
    found = asked(wide(**fields))
    assert len(found) == len(words)
    assert all(text.startswith(start) for text, start in zip(found, words, strict=True))


def test_narrow_interval_asks_for_nothing() -> None:
    posterior = wide(ends_share_of_variance=0.9)
    samples = posterior.samples.copy()
    samples[:, 0] = np.linspace(0.99, 1.01, len(samples))
    assert asked(replace(posterior, samples=samples)) == []


def test_ends_of_a_sprung_bar_decide_until_stated() -> None:
    options = UpdateOptions(samples=400)
    (open_, stated) = (
        update([sprung(BAR)], described("beam2", hanger, "description"), options)
        for hanger in (BAR, replace(BAR, ends="fork"))
    )
    assert open_.ends_share_of_variance > 0.5
    assert open_.inclination_share_of_variance < 0.2
    assert np.isnan(stated.ends_share_of_variance)
    assert not any(each.startswith(ENDS) for each in asked(stated))


def test_inclination_has_a_share_where_it_is_a_parameter_and_open() -> None:
    hanger = replace(BAR, fittings_m=(0.3, 0.3), ends="fork")
    options = UpdateOptions(samples=100)
    shares = [
        update(
            [sprung(BAR)], described("beam1", each, "description"), options
        ).inclination_share_of_variance
        for each in (hanger, replace(hanger, inclination_deg=90.0))
    ]
    assert np.isfinite(shares[0])
    assert np.isnan(shares[1])
