"""What is measured in a case of each richness; the hanger's tension is drawn with the hanger."""

from __future__ import annotations

from dataclasses import replace

from shm.simulate import CampaignPlan, Reality
from shm.values import Richness

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
