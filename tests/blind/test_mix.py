"""Which cases a trial consists of."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from shm.blind.making.case import RICHNESSES, WAYS, Draft, balanced, drafts
from shm.values import MIX

EFFECTS = tuple(f"effect{number}" for number in range(19))
UNLISTED = ("crack", "guide", "damper")


def drawn(cases: int, seed: int = 1) -> tuple[Draft, ...]:
    return drafts(cases, WAYS, EFFECTS, UNLISTED, np.random.default_rng(seed))


@pytest.mark.parametrize("cases", [24, 300, 426])
def test_kinds_richnesses_and_ways_have_their_shares_to_within_one_case(cases: int) -> None:
    found = drawn(cases)
    for name, shares in (("kind", MIX), ("richness", RICHNESSES)):
        counts = Counter(getattr(draft, name) for draft in found)
        assert all(abs(counts[each] - cases * share) <= 1 for each, share in shares.items())
    ways = Counter(draft.way for draft in found)
    assert abs(ways["modes"] - ways["recordings"]) <= 1


def test_each_combination_has_its_share_to_within_two_cases_of_three_hundred() -> None:
    counts = Counter((draft.kind, draft.richness, draft.way) for draft in drawn(300))
    for kind, of_kind in MIX.items():
        for richness, of_richness in RICHNESSES.items():
            for way in WAYS:
                wanted = 300 * of_kind * of_richness / 2
                assert abs(counts[kind, richness, way] - wanted) < 2


def test_margins_of_a_table_are_kept_at_every_count() -> None:
    wanted = np.outer([0.5, 0.3, 0.2], [0.6, 0.4])
    cells = balanced(wanted, 40)
    for count in range(1, 41):
        rows = Counter(row for row, _ in cells[:count])
        assert all(abs(rows[row] - count * wanted[row].sum()) < 1.5 for row in range(3))


def test_sizes_of_a_kind_and_richness_are_spread_evenly() -> None:
    shares = [d.share for d in drawn(300) if (d.kind, d.richness) == ("one", "everything")]
    empty, _ = np.histogram(shares, len(shares), (0, 1))
    assert np.all(empty == 1)


def test_every_effect_takes_its_turn_at_being_tried_first() -> None:
    found = [d for d in drawn(300) if (d.kind, d.richness) == ("one", "shapes")]
    firsts = Counter(draft.effects[0] for draft in found)
    assert max(firsts.values()) - min(firsts[name] for name in EFFECTS) <= 1
    assert all(sorted(draft.effects) == sorted(EFFECTS) for draft in found)


def test_what_the_catalogue_lacks_is_planted_in_unknown_cases_only() -> None:
    for draft in drawn(64):
        known = UNLISTED if draft.kind == "unknown" else EFFECTS
        assert set(draft.effects) == set(known)


def test_the_order_of_cases_tells_nothing_of_their_kind() -> None:
    """Runs of equal kinds are about as many as chance makes, within four standard deviations."""
    kinds = [draft.kind for draft in drawn(300)]
    changes = sum(a != b for a, b in pairwise(kinds))
    chance = 1 - sum(share**2 for share in MIX.values())
    assert abs(changes - 299 * chance) < 4 * np.sqrt(299 * chance * (1 - chance))
    assert drawn(300, seed=2) != drawn(300, seed=1)
