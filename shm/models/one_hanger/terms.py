"""Define what is uncertain of any bar: fittings, turnbuckles, inclination, sag.

Each `Term` is one parameter of a hanger with its prior, as a map from normal scores.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from shm.assumptions import Assumption, Assumptions
from shm.values import PLANES, FloatArray, Hanger

FITTING_STIFFNESS = ("fitting_stiffness_transverse", "fitting_stiffness_longitudinal")
FITTING_MASS = "fitting_mass"
TURNBUCKLE_STIFFNESS, TURNBUCKLE_MASS = "turnbuckle_stiffness", "turnbuckle_mass"
INCLINATION, SAG_SHAPE, SAG_STIFFNESS = "inclination", "sag_shape", "sag_stiffness"
FLATTEST_DEG = 10.0

MOST_SD = 6.0  # a normal distribution has 2e-9 beyond
_LEANS = 3.0  # standard deviations, from which a stated lean is known to be one
_UPRIGHT, _LEAST_SHARE = 1e-6, 1e-9


@dataclass(frozen=True)
class Term:
    """One uncertain quantity of the bar: `value` of its normal scores (n,), and their inverse.

    `plane` is where it is felt, "" in both.
    """

    name: str
    unit: str
    value: Callable[[FloatArray], FloatArray]
    score: Callable[[FloatArray], FloatArray]
    plane: str = ""

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the least and the largest value."""
        low, high = self.value(np.array([-MOST_SD, MOST_SD]))
        return float(min(low, high)), float(max(low, high))


def terms_of(hanger: Hanger, fittings_m: tuple[float, float]) -> list[Term]:
    """Return the terms of a described hanger with fittings of these lengths."""
    assumed, found = hanger.assumptions, []
    if any(fittings_m):
        stiffness, mass = fittings_of(hanger.end_kind, assumed)
        for name, plane in zip(FITTING_STIFFNESS, PLANES, strict=True):
            found.append(_log_normal(name, stiffness.value, stiffness.sd, plane))
        found.append(_log_normal(FITTING_MASS, mass.value, mass.sd))
    if hanger.turnbuckles:
        stiff, heavy = assumed.turnbuckle_stiffness_log_sd, assumed.turnbuckle_mass_log_sd
        found.append(_log_normal(TURNBUCKLE_STIFFNESS, 0.0, stiff.value))
        found.append(_log_normal(TURNBUCKLE_MASS, 0.0, heavy.value))
    found += [_inclination(hanger), Term(SAG_SHAPE, "1", scipy.special.ndtr, quantile, PLANES[1])]
    if math.isfinite(hanger.inclination_deg):  # else what leans is open by as much
        sag = assumed.sag_stiffness_log
        found.append(_log_normal(SAG_STIFFNESS, sag.value, sag.sd, PLANES[1]))
    return found


def quantile(share: FloatArray) -> FloatArray:
    """Return normal scores (n,) of a uniform quantity."""
    return np.asarray(scipy.special.ndtri(share.clip(_LEAST_SHARE, 1 - _LEAST_SHARE)))


def _log_normal(name: str, mean: float, sd: float, plane: str = "") -> Term:
    return Term(
        name,
        "1",
        lambda score: np.exp(mean + sd * score.clip(-MOST_SD, MOST_SD)),
        lambda value: (np.log(value) - mean) / sd,
        plane,
    )


def _inclination(hanger: Hanger) -> Term:
    """Return the inclination: a stated one, or that of a hanger that leans a little at most."""
    lean_deg, most = 90 - hanger.inclination_deg, 90 - FLATTEST_DEG
    sd = hanger.assumptions.inclination_sd_deg.value
    if lean_deg > _LEANS * sd:
        return Term(
            INCLINATION,
            "deg",
            lambda score: 90 - (lean_deg + sd * score).clip(0, most),
            lambda value: (90 - value - lean_deg) / sd,
            PLANES[1],
        )
    if math.isfinite(lean_deg):
        usual = math.hypot(sd, lean_deg)
        sign = 2.0
    else:
        usual, sign = hanger.assumptions.usual_lean_deg.value, 1.0
    # Exponential with the usual lean as median; of half that where it is stated vertical.
    scale = usual / sign / math.log(2)
    return Term(
        INCLINATION,
        "deg",
        lambda score: 90 - (-scale * scipy.special.log_ndtr(-score)).clip(0, most),
        lambda value: -scipy.special.ndtri_exp(-((90 - value).clip(_UPRIGHT, most)) / scale),
        PLANES[1],
    )


def fittings_of(kind: str, assumed: Assumptions) -> tuple[Assumption, Assumption]:
    """Return ln of the stiffness and of the mass of fittings of one kind of end."""
    return {
        "socket": (assumed.socket_stiffness_log, assumed.socket_mass_log),
        "welded": (assumed.welded_stiffness_log, assumed.welded_mass_log),
        "plate": (assumed.plate_stiffness_log, assumed.plate_mass_log),
        "threaded": (assumed.threaded_stiffness_log, assumed.threaded_mass_log),
        "fork": (assumed.fork_stiffness_log, assumed.fork_mass_log),
        "unstated": (assumed.unstated_stiffness_log, assumed.unstated_mass_log),
    }[kind]
