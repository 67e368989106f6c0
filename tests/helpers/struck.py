"""Records of the struck bar's world as this software reads and identifies them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.identify import IdentifyOptions
from shm.identify.identification import Identification, identify
from shm.values import Channel, Recording
from tests.helpers.hangers import HANGER_3
from tests.worlds import struck_bar as world

STRUCK = replace(HANGER_3, plate=None)
"""The world's bar as its owner describes it."""


def recordings(records: list[world.Record], crew: world.Crew) -> list[Recording]:
    return [
        Recording(
            f"{number}.npz",
            (
                Channel("hammer", "force", record.force_n, record.plane, crew.hammer_m),  # type: ignore[arg-type]
                *(
                    Channel(f"{plane}{x_m}", "acceleration", values, plane, x_m)  # type: ignore[arg-type]
                    for x_m, both in zip(crew.sensors_m, record.motion_m_s2, strict=True)
                    for plane, values in zip(world.PLANES, both, strict=True)
                ),
            ),
            record.rate_hz,
            STRUCK.id,
            temperature_c=10.0,
        )
        for number, record in enumerate(records)
    ]


def identified(
    part: world.Part | None, level: float, seed: list[int], name: str, crew: world.Crew
) -> Identification:
    rng = np.random.default_rng(seed)
    records = world.tested(world.Hanger(part=part), crew, level, rng)
    options = IdentifyOptions(reference_force_n=crew.peak_n, frequency_allowance=1e-4)
    return identify(recordings(records, crew), options, test_id=name, hanger=STRUCK)
