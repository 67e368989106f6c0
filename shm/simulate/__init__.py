"""Hammer tests of a hanger in the time domain, by a discretisation of their own.

Beam finite elements and modal superposition; no code is shared with `shm.models`, so that what is
planted here and found there agrees only if both are right. Besides, modal tests of whole campaigns
of a hanger with planted effects.
"""

from __future__ import annotations

from shm.simulate.ambient import AmbientPlan, ambient_test
from shm.simulate.campaign import (
    Campaign,
    CampaignPlan,
    CampaignTruth,
    bar_in_test,
    campaign,
    campaign_with_truth,
    realised,
)
from shm.simulate.detectable import at_share, scaled_to, size_of
from shm.simulate.disturbances import DISTURBANCES, Planted
from shm.simulate.effects import (
    PLANTED,
    UNLISTED,
    PlantedEffect,
    TestConditions,
    choices,
    drawn,
)
from shm.simulate.elements import natural_frequencies
from shm.simulate.hammer import SimulatedTest, hammer_test, simulated_test
from shm.simulate.planted import PlantedModes, bar_under, modes_under
from shm.simulate.reality import Deviations, Reality, SensorError, drawn_hanger
from shm.simulate.state import HammerPlan, HangerState, spread_places_m
