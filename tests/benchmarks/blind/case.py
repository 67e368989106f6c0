"""One case: its files, and its line of the key.

What is measured in a case of each richness; the hanger's tension is drawn with the hanger.

What is planted in a case: effects at places where its data can show them, at a wanted size.

Which cases a trial consists of: fixed proportions, shuffled.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from shm.bridge import load_hanger
from shm.documents import dump
from shm.errors import UsageError
from shm.modes_document import modes_document
from shm.simulate import HangerState, PlantedEffect
from shm.values import FloatArray, Hanger, IntArray
from tests.benchmarks.blind.layout import CASE_FILE, CASE_SCHEMA, HANGER_FILE, MODES_FILE
from tests.benchmarks.blind.truth import MIX, PlantedKind, Richness, TrueCase, TrueEffect
from tests.worlds.simulated.campaign import CampaignPlan, CampaignTruth, campaign_with_truth
from tests.worlds.simulated.detectable import at_share, scaled_to, size_of
from tests.worlds.simulated.effects.registry import PLANTED, choices, drawn
from tests.worlds.simulated.reality import Reality, drawn_hanger

# Judgement: most of what campaigns measure as a rule (frequencies, shapes, everything), some of
# what lies between; a twelfth of 480 cases is 40, whose shares are known to 0.13.
RICHNESSES: dict[Richness, float] = {
    "one plane": 1 / 12,
    "two planes": 1 / 4,
    "known mass": 1 / 12,
    "shapes": 1 / 4,
    "conditions": 1 / 12,
    "everything": 1 / 4,
}


@dataclass(frozen=True)
class Draft:
    """A case before anything is drawn for it.

    `share` (0 to 1) is where its size lies in the range of sizes; `effects` are names in the order
    in which they are tried.
    """

    case: str
    kind: PlantedKind
    richness: Richness
    share: float
    effects: tuple[str, ...]


def drafts(
    cases: int,
    effects: Sequence[str],
    unlisted: Sequence[str],
    rng: np.random.Generator,
) -> tuple[Draft, ...]:
    """The cases of a trial in an order that says nothing.

    Within each kind and richness sizes are spread evenly over their range, and every effect takes
    its turn at being tried first.
    """
    kinds, richnesses = tuple(MIX), tuple(RICHNESSES)
    wanted = np.outer(list(MIX.values()), list(RICHNESSES.values()))
    found = []
    for (kind, richness), count in Counter(balanced(wanted, cases)).items():
        name = kinds[kind]
        known = unlisted if name == "unknown" else effects
        shares = (rng.permutation(count) + rng.uniform(size=count)) / count
        for share, order in zip(shares, _turns(known, count, rng), strict=True):
            found.append((name, richnesses[richness], float(share), order))
    shuffled = [found[place] for place in rng.permutation(len(found))]
    return tuple(Draft(f"c{i + 1:04d}", *each) for i, each in enumerate(shuffled))


def balanced(wanted: FloatArray, count: int) -> list[tuple[int, ...]]:
    """`count` cells of a table of proportions, so that all its margins are as near as they can be.

    One cell after the other: the one whose margins, of every order, lack most.
    """
    axes = range(wanted.ndim)
    margins = [
        tuple(set(axes) - set(kept))
        for order in range(1, wanted.ndim + 1)
        for kept in combinations(axes, order)
    ]
    taken: IntArray = np.zeros(wanted.shape, dtype=np.int64)
    cells = []
    for done in range(1, count + 1):
        lack = wanted * done - taken
        total = sum(lack.sum(axis=over, keepdims=True) for over in margins)
        cell = np.unravel_index(int(np.argmax(np.broadcast_to(total, wanted.shape))), wanted.shape)
        taken[cell] += 1
        cells.append(tuple(int(each) for each in cell))
    return cells


def _turns(names: Sequence[str], count: int, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """For each of `count` cases all names in random order, each first equally often."""
    firsts: list[str] = []
    while len(firsts) < count:
        firsts += [str(name) for name in rng.permutation(list(names))]
    orders = []
    for first in firsts[:count]:
        rest = rng.permutation([name for name in names if name != first])
        orders.append((first, *(str(name) for name in rest)))
    return orders


BASELINE = "beam1"
_DRAWS = 5  # judgement: of an effect or its place, until one can have the size; then another's turn


def make_case(directory: Path, draft: Draft, seed: np.random.SeedSequence) -> TrueCase:
    """Makes the case's folder and gives what was planted in it."""
    described, chosen, planted, measured = map(np.random.default_rng, seed.spawn(4))
    directory.mkdir(parents=True)
    site = _described(directory / HANGER_FILE, draft, described)
    told = {"schema": CASE_SCHEMA, "baseline": BASELINE, "seed": int(chosen.integers(2**31))}
    (directory / CASE_FILE).write_text(dump(told) + "\n", encoding="utf-8")
    effects, truth = _planted(directory, draft, site, planted, measured)
    return TrueCase(
        draft.case,
        draft.kind,
        draft.richness,
        tuple(TrueEffect(each.name, each.at, each.values, site.size((each,))) for each in effects),
        site.size(effects),
        truth.tension_n,
        _left_out(draft, effects, chosen),
    )


def _described(path: Path, draft: Draft, rng: np.random.Generator) -> Site:
    """Draws a hanger, writes its description, and takes it as that says."""
    drawn, state = drawn_hanger(rng)
    path.write_text(
        f"[[hanger]]\nid = {drawn.id}\ndiameter_m = {drawn.diameter_m!r}\n"
        f"length_m = {drawn.length_m!r}\nelastic_modulus_pa = {drawn.elastic_modulus_pa!r}\n"
        f"density_kg_m3 = {round(drawn.mass_per_length_kg_m / drawn.area_m2, 6)!r}\n"
        f"nominal_tension_n = {drawn.nominal_tension_n!r}\n",
        encoding="utf-8",
    )
    return Site(load_hanger(path), state, PLANS[draft.richness])


def _planted(
    directory: Path,
    draft: Draft,
    site: Site,
    planted: np.random.Generator,
    measured: np.random.Generator,
) -> tuple[tuple[PlantedEffect, ...], CampaignTruth]:
    """What is planted, and measured of it; other effects where the bar as it was made buckles.

    The one described may stand what that one does not.
    """
    effects = planted_effects(draft, site, planted)
    for _ in range(_DRAWS):
        try:
            return effects, _write_modes(directory, site, effects, measured)
        except UsageError:
            effects = planted_effects(draft, site, planted)
    return effects, _write_modes(directory, site, effects, measured)


def _write_modes(
    directory: Path, site: Site, effects: Sequence[PlantedEffect], rng: np.random.Generator
) -> CampaignTruth:
    made = campaign_with_truth(site.hanger, site.state, effects, site.plan, rng)
    text = dump(modes_document(made.tests)) + "\n"
    (directory / MODES_FILE).write_text(text, encoding="utf-8")
    return made.truth


def _left_out(
    draft: Draft, effects: Sequence[PlantedEffect], rng: np.random.Generator
) -> tuple[str, ...]:
    """What the second round takes out of the catalogue: the truth, or anything where it is none."""
    if draft.kind == "unknown":
        return ()
    return tuple(each.name for each in effects) or (str(rng.choice(list(PLANTED))),)


_ALL = CampaignPlan(tension_spread=0.0, reality=Reality())
# At 10 degrees, the mean of the other plans' temperatures, and the reference level.
_ONE_TEST = replace(_ALL, shapes=False, temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0)
PLANS: dict[Richness, CampaignPlan] = {
    "one plane": replace(_ONE_TEST, planes=("transverse",)),
    "three modes": replace(_ONE_TEST, planes=("transverse",), modes=3),
    "two planes": _ONE_TEST,
    "known mass": replace(_ONE_TEST, mass_share=_ALL.mass_share),
    "shapes": replace(_ONE_TEST, shapes=True),
    "conditions": replace(_ALL, shapes=False, mass_share=0.0),
    "everything": _ALL,
}


_SIZES, _SIZES_OF_A_PAIR = (1.0, 1000.0), (8.0, 100.0)
"""Up to what real hangers show: a few percent of frequencies that are known to 1e-4."""
_ABOUT = 1.1  # judgement: a size is drawn log-uniform over decades, so a tenth more is that size
_WEAK = (0.02, 0.2)  # judgement: the weak end of a range without its edge, which no interval holds
_OF_SENSORS = ("sensor_mass", "sensor_misalignment", "skewed_principal_axes")
"""Not planted without shapes: then nobody knows where the sensors sit or what they see across."""
_OF_LEVELS = ("geometric_hardening", "joint_softening")
"""Not planted where all hits are alike: they are then a tension and a spring for good."""


@dataclass(frozen=True)
class Site:
    """A hanger, its state, and how it is measured."""

    hanger: Hanger
    state: HangerState
    plan: CampaignPlan

    def size(self, effects: Sequence[PlantedEffect]) -> float:
        """The size of effects together; 0 of none, infinite where the bar could not stand them."""
        if not effects:
            return 0.0
        try:
            return size_of(self.hanger, self.state, effects, self.plan)
        except UsageError:
            return math.inf


def planted_effects(
    draft: Draft, site: Site, rng: np.random.Generator
) -> tuple[PlantedEffect, ...]:
    """The effects of a case; raises UsageError where none can be seen in its data."""
    if draft.kind == "none":
        return ()
    names = [name for name in draft.effects if _may_be_called_so(name, site.plan)]
    found = _pair(names, site, rng) if draft.kind == "two" else _single(draft, names, site, rng)
    if not found:
        raise UsageError(
            f"nothing can be planted that the data of {draft.case} show.",
            remedy="Make the trial with another seed.",
        )
    return found


def _may_be_called_so(name: str, plan: CampaignPlan) -> bool:
    """Whether the data can hold what makes the effect the one of its name."""
    if name in _OF_SENSORS:
        return plan.shapes
    return name not in _OF_LEVELS or len(plan.amplitudes) > 1


def _single(
    draft: Draft, names: Sequence[str], site: Site, rng: np.random.Generator
) -> tuple[PlantedEffect, ...]:
    """The first effect that can have the size; where none can, that of half the logarithm."""
    for share in (draft.share, draft.share / 2, draft.share / 4):
        for name in names:
            found = _of_size(name, _log_uniform(_SIZES, share), site, rng)
            if found is not None:
                return (found,)
    return ()


def _pair(names: Sequence[str], site: Site, rng: np.random.Generator) -> tuple[PlantedEffect, ...]:
    """Two effects, each to be seen by itself, that do not undo each other."""
    first: PlantedEffect | None = None
    for name in names:
        found = _of_size(name, _log_uniform(_SIZES_OF_A_PAIR, rng.uniform()), site, rng)
        if first is None or found is None:
            first = first or found
        elif _SIZES_OF_A_PAIR[0] <= site.size((first, found)) < math.inf:
            return first, found
    return ()


def _of_size(name: str, size: float, site: Site, rng: np.random.Generator) -> PlantedEffect | None:
    """An effect of a size at a place drawn anew until it can have it.

    Where its weakest is larger everywhere, it is drawn from the weak end of its range. None where
    these data cannot show it.
    """
    hanger, plan = site.hanger, site.plan
    places = choices(name, plan.places_m(hanger), [test.id for test in plan.tests(hanger)])
    weak: PlantedEffect | None = None
    for _ in range(_DRAWS):
        effect = drawn(name, str(rng.choice(places)), hanger, rng)
        scaled = scaled_to(size, hanger, site.state, effect, plan)
        if scaled is not None and site.size((scaled,)) < _ABOUT * size:
            return scaled
        if scaled is not None and weak is None:
            weak = at_share(float(rng.uniform(*_WEAK)), hanger, effect)
    return weak if weak is not None and math.isfinite(site.size((weak,))) else None


def _log_uniform(bounds: tuple[float, float], share: float) -> float:
    return float(bounds[0] * (bounds[1] / bounds[0]) ** share)
