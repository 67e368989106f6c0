"""One case: its files, and its line of the key.

What is measured in a case of each richness; the hanger's tension is drawn with the hanger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shm.blind.layout import CASE_FILE, CASE_SCHEMA, HANGER_FILE, MODES_FILE
from shm.blind.making.mix import Draft
from shm.blind.making.planting import Site, planted_effects
from shm.bridge import load_hanger
from shm.documents import dump
from shm.errors import UsageError
from shm.modes_document import modes_document
from shm.read.single import write_single
from shm.simulate import (
    PLANTED,
    CampaignPlan,
    CampaignTruth,
    PlantedEffect,
    Reality,
    campaign_with_truth,
    drawn_hanger,
)
from shm.simulate.recorded import Recorder, recorded
from shm.values import Richness, TrueCase, TrueEffect

BASELINE = "beam1"
_DRAWS = 5


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
        draft.way,
        tuple(TrueEffect(each.name, each.at, each.values, site.size((each,))) for each in effects),
        site.size(effects),
        truth.tension_n,
        truth.frequencies,
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
    measure = _write_recordings if draft.way == "recordings" else _write_modes
    effects = planted_effects(draft, site, planted)
    for _ in range(_DRAWS):
        try:
            return effects, measure(directory, site, effects, measured)
        except UsageError:
            effects = planted_effects(draft, site, planted)
    return effects, measure(directory, site, effects, measured)


def _write_modes(
    directory: Path, site: Site, effects: Sequence[PlantedEffect], rng: np.random.Generator
) -> CampaignTruth:
    made = campaign_with_truth(site.hanger, site.state, effects, site.plan, rng)
    text = dump(modes_document(made.tests)) + "\n"
    (directory / MODES_FILE).write_text(text, encoding="utf-8")
    return made.truth


def _write_recordings(
    directory: Path, site: Site, effects: Sequence[PlantedEffect], rng: np.random.Generator
) -> CampaignTruth:
    """Files t1_1.npz, t1_2.npz, ...: each test, and in it each plane that was hit."""
    made = recorded(site.hanger, site.state, effects, site.plan, Recorder(), rng)
    for test in made.tests:
        for number, recording in enumerate(test.recordings, 1):
            write_single(recording, directory / f"{test.id}_{number}.npz")
    return made.truth


def _left_out(
    draft: Draft, effects: Sequence[PlantedEffect], rng: np.random.Generator
) -> tuple[str, ...]:
    """What the second round takes out of the catalogue: the truth, or anything where it is none."""
    if draft.kind == "unknown":
        return ()
    return tuple(each.name for each in effects) or (str(rng.choice(list(PLANTED))),)


_ALL = CampaignPlan(tension_spread=0.0, reality=Reality())
_ONE_TEST = replace(_ALL, shapes=False, temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0)
PLANS: dict[Richness, CampaignPlan] = {
    "one plane": replace(_ONE_TEST, planes=("transverse",)),
    "two planes": _ONE_TEST,
    "known mass": replace(_ONE_TEST, mass_share=_ALL.mass_share),
    "shapes": replace(_ONE_TEST, shapes=True),
    "conditions": replace(_ALL, shapes=False, mass_share=0.0),
    "everything": _ALL,
}
