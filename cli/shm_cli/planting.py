"""What `shm simulate` reads and writes of planted effects and campaigns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from shm.documents import dump
from shm.errors import UsageError
from shm.modes_document import modes_document
from shm.simulate import (
    CampaignPlan,
    CampaignTruth,
    HangerState,
    PlantedEffect,
    TestConditions,
    campaign_with_truth,
)
from shm.simulate.reality import GLOBAL
from shm.values import AddedMass, Hanger

# Of the temperatures and levels of `CampaignPlan` the usual ones are left.
LACKS: dict[str, dict[str, Any]] = {
    "shapes": {"shapes": False},
    "longitudinal": {"planes": ("transverse",)},
    "temperatures": {"temperatures_c": (10.0,)},
    "levels": {"amplitudes": (1.0,)},
    "mass": {"mass_share": 0.0},
}


def effect_of(text: str) -> PlantedEffect:
    """Reads `NAME:AT:param=value,...`; raises UsageError where it is not that."""
    name, _, rest = text.partition(":")
    at, _, pairs = rest.partition(":")
    try:
        values = dict(_pair(pair) for pair in pairs.split(","))
    except ValueError:
        raise UsageError(
            f"--effect {text!r} is not NAME:AT:param=value,...",
            remedy="Write --effect 'point_mass:everywhere:mass_kg=12,x_m=3.4'.",
        ) from None
    return PlantedEffect(name, at, values)


def _pair(text: str) -> tuple[str, float]:
    name, value = text.split("=")
    return name.strip(), float(value)


def mass_of(text: str | None) -> AddedMass | None:
    """Reads `KG:X`; raises UsageError where it is not that."""
    if text is None:
        return None
    try:
        mass_kg, x_m = (float(part) for part in text.split(":"))
    except ValueError:
        raise UsageError(
            f"--added-mass {text!r} is not KG:X.", remedy="Write --added-mass 25:3.6."
        ) from None
    return AddedMass(mass_kg, x_m)


def conditions_of(
    temperature_c: float,
    reference_c: float,
    amplitude: float,
    added_mass: AddedMass | None,
) -> TestConditions:
    """What a recording is made under; an unknown temperature is the reference."""
    shift = 0.0 if np.isnan(temperature_c) else temperature_c - reference_c
    return TestConditions("", shift, amplitude, added_mass)


def write_campaign(
    hanger: Hanger,
    state: HangerState,
    effects: Sequence[PlantedEffect],
    lacks: Sequence[str],
    sensors: int | None,
    seed: int,
    out: Path,
) -> tuple[Path, Path]:
    """Writes a campaign's modal tests and, beside them, their truth."""
    plan = CampaignPlan()
    for each in lacks:
        plan = replace(plan, **LACKS[each])
    if sensors is not None:
        plan = replace(plan, sensors=sensors)
    made = campaign_with_truth(hanger, state, effects, plan, np.random.default_rng(seed))
    modes = out / f"hanger{hanger.id}.modes.json"
    truth = out / f"hanger{hanger.id}.truth.json"
    modes.write_text(dump(modes_document(made.tests)) + "\n", encoding="utf-8")
    truth.write_text(dump(truth_document(made.truth, seed)) + "\n", encoding="utf-8")
    return modes, truth


def truth_document(truth: CampaignTruth, seed: int) -> dict[str, Any]:
    """What a campaign was made of; an infinite parameter is written as text."""
    return {
        "tension_n": truth.tension_n,
        "deviations": {name: getattr(truth.deviations, name) for name in GLOBAL},
        "effects": [
            {
                "effect": effect.name,
                "at": effect.at,
                "parameters": {
                    name: value if np.isfinite(value) else str(value)
                    for name, value in effect.values.items()
                },
            }
            for effect in truth.effects
        ],
        "seed": seed,
    }
