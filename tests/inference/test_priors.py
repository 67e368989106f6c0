"""Hold priors of end fixity, tension and clamped classes against what is stated of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from shm.assumptions import DEFAULTS
from shm.inference.answer.updating import class_probabilities
from shm.inference.problem.priors import SPRINGS, Ends, TensionPrior, clamped_probability, fixity_of
from shm.models import build
from shm.values import Hanger
from tests.helpers.hangers import ROD
from tests.helpers.nouns import a_posterior, a_test

KINDS = ("socket", "welded", "plate", "threaded", "fork", "unstated")
SWAPS = (("log10_k1", "log10_k3"), ("log10_k2", "log10_k4"))
PLANE = ("log10_k1", "log10_k3")


def fixity(log10_k: np.ndarray, slenderness: np.ndarray, hanger: Hanger) -> np.ndarray:
    """Return k/(k + EI/L + sqrt(EI T)/2)."""
    k = 10**log10_k
    unit = hanger.bending_stiffness_n_m2 / hanger.length_m
    return k / (k + unit * (1 + slenderness / 2))


def drawn(
    kind: str, springs: tuple[str, ...] = SPRINGS, n: int = 20_000
) -> tuple[Ends, np.ndarray, np.ndarray]:
    """Return ends, and n draws of their slenderness (n,) and fixity (n, 4)."""
    hanger, rng = replace(ROD, ends="" if kind == "unstated" else kind), np.random.default_rng(1)
    ends = Ends(hanger, springs, SWAPS)
    slenderness = rng.uniform(2, 60, n)
    springs_ = ends.log10_springs(rng.standard_normal((n, len(springs))), slenderness, rng)
    held = [fixity(springs_[name], slenderness, hanger) for name in SPRINGS]
    return ends, slenderness, np.column_stack(held)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("springs", [SPRINGS, PLANE])
def test_the_fixity_of_each_end_has_its_beta_distribution(
    kind: str, springs: tuple[str, ...]
) -> None:
    _, slenderness, held = drawn(kind, springs)
    row = fixity_of(kind, DEFAULTS)
    size = row.value * (1 - row.value) / row.sd**2 - 1
    beta = stats.beta(row.value * size, (1 - row.value) * size)
    for column in held.T:
        assert stats.kstest(column, beta.cdf).pvalue > 1e-4
        assert abs(np.corrcoef(column, slenderness)[0, 1]) < 0.03
        assert column.mean() == pytest.approx(row.value, abs=0.01)
        assert column.std() == pytest.approx(row.sd, abs=0.01)


def test_ends_of_one_hanger_are_similar_as_stated() -> None:
    _, _, held = drawn("socket")
    rank = stats.spearmanr(held).statistic
    expected = 6 / np.pi * np.arcsin(DEFAULTS.similarity_of_ends.value / 2)  # of normal scores
    np.testing.assert_allclose(rank[np.triu_indices(4, 1)], expected, atol=0.02)


@pytest.mark.parametrize("springs", [SPRINGS, PLANE])
def test_scores_invert_springs(springs: tuple[str, ...]) -> None:
    ends, rng = Ends(ROD, springs, SWAPS), np.random.default_rng(2)
    scores, slenderness = rng.standard_normal((500, len(springs))), rng.uniform(1, 80, 500)
    found = ends.log10_springs(scores, slenderness, None)
    np.testing.assert_allclose(ends.scores(found, slenderness, 500), scores, atol=1e-4)
    assert set(found) == set(SPRINGS)


def test_folding_and_exchanging_keep_the_density_of_ends_normalised() -> None:
    ends, rng = Ends(ROD, SPRINGS, SWAPS), np.random.default_rng(3)
    scores = rng.standard_normal((40_000, 4))
    raised = np.exp(ends.log_folded(scores))
    assert set(np.round(np.unique(raised), 9)) == {0.0, 4.0}
    assert raised.mean() == pytest.approx(1, abs=0.04)
    folded = ends.fold(scores)
    assert np.isfinite(ends.log_folded(folded)).all()
    np.testing.assert_allclose(ends.fold(folded), folded, atol=1e-9)
    for column in ends.exchanged(folded, rng).T:
        assert stats.kstest(column, "norm").pvalue > 1e-4


def test_the_tension_prior_inverts_itself_and_holds_what_it_states() -> None:
    ratio = DEFAULTS.tension_ratio.bounds
    prior, (low, high) = TensionPrior(ratio), np.log(ratio)
    z = np.linspace(-4.5, 4.5, 400)
    np.testing.assert_allclose(prior.score(prior.value(z)), z, atol=2e-3)
    logs = prior.value(np.random.default_rng(1).standard_normal(40_000))
    assert low <= logs.min() < logs.max() <= high
    designed, sd = DEFAULTS.as_designed_share.value, DEFAULTS.as_designed_log_sd.value
    normal = stats.norm(0, sd)
    inside = normal.cdf(high) - normal.cdf(low)

    def below(log: np.ndarray) -> np.ndarray:
        flat = (1 - designed * inside) * (log - low) / (high - low)
        return np.asarray(flat + designed * (normal.cdf(log) - normal.cdf(low)))

    assert stats.kstest(logs, below).pvalue > 0.01


@pytest.mark.parametrize("kind", KINDS)
def test_clamped_ends_are_as_probable_as_their_kind_states(kind: str) -> None:
    hanger = replace(ROD, ends="" if kind == "unstated" else kind)
    models = [build(name, hanger) for name in ("beam1", "beam2")]
    found = [replace(a_posterior(), model=each.name, log_evidence=-20.0) for each in models]
    chances = class_probabilities(found, models, [a_test()])
    expected = clamped_probability(kind, DEFAULTS)
    assert expected == DEFAULTS[f"{kind}_clamped"].value
    assert chances == pytest.approx({"beam1": expected, "beam2": 1 - expected})


def test_fittings_of_a_strand_are_sockets_unless_it_states_other_ends() -> None:
    strand = replace(ROD, kind="strand", fittings_m=(0.3, 0.3))
    assert strand.end_kind == "socket"
    assert replace(strand, fittings_m=(0.0, 0.0)).end_kind == "unstated"
    assert replace(strand, ends="fork").end_kind == "fork"
    assert ROD.end_kind == "unstated"
    own = DEFAULTS.with_numbers(fork_clamped=0.5)
    assert clamped_probability("fork", own) == 0.5
    assert math.isclose(fixity_of("socket", own).value, DEFAULTS.socket_fixity.value)
