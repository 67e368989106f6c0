"""Effects of what reads the tension beside the vibration: load cells, jacks, weights."""

from __future__ import annotations

import math
from dataclasses import replace

from shm.models.base import Conditions
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger


class LoadScale(Effect):
    """The tension that was read is the true one times 1 + error: load cell, jack, scales.

    Between tests the differences of `tension_read_n` are off by it; where the description knows the
    tension (`[hanger.scatter] tension`), so is that one. The hanger itself is as described.
    """

    name = "load_scale"
    title = "A load cell or jack that is off by a factor"
    phrase = "a load cell or jack that reads {load_error:too much|too little}"
    source = (
        "ISO 376:2011, Calibration of force-proving instruments; fib Bulletin 30 (2005), "
        "Acceptance of stay cable systems."
    )
    seen_by = ("tensions that were read", "several tests")
    imitated_by = ("distributed_mass", "effective_length", "temperature_tension")
    of_the_hanger = False

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if not hanger.nominal_tension_n:
            return "The bar carries no tension that could be read."
        if math.isfinite(hanger.scatter.tension) or len(survey.tensions_read_n) > 1:
            return ""
        return (
            "It takes a tension that is known, or tests between which a load cell or jack reads "
            "different tensions."
        )

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return (Variant("all readings"),)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "load_error",
            "fraction",
            0.005,
            0.3,
            0.0,
            "0.5 to 30 %, either way: from a cell out of calibration, over 9.81 taken as 10 and "
            "the friction of a jack, to the factor of another gauge.",
            spread="logarithmic",
            signed=True,
            most=0.9,
        )
        return (size,)

    def applied(
        self,
        physical: PhysicalHanger,
        values: FloatArray,
        variant: Variant,
        conditions: Conditions,
        hanger: Hanger,
    ) -> PhysicalHanger:
        error = values[:, 0]
        known = math.isfinite(hanger.scatter.tension)
        read_n = physical.tension_n if known else conditions.tension_shift_n
        return replace(physical, tension_n=physical.tension_n - read_n * error / (1 + error))
