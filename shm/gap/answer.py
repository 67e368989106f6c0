"""What an attribution claims, and what it leaves possible."""

from __future__ import annotations

import numpy as np

from shm.gap.attribution import Attribution, Explanation
from shm.gap.contract import Fit
from shm.inference.tmcmc import normalised


def answered(attribution: Attribution) -> list[tuple[float, Fit]]:
    """The fits, with their probabilities, of what the diagnosis claims.

    All members of the leading group: which of them it is, the data cannot tell.
    """
    leading = attribution.leading
    if leading is None:
        no_gap = attribution.leads == "no gap"
        return [(1.0, attribution.baseline if no_gap else attribution.unexplained)]
    group = [
        each
        for each in attribution.explanations
        if each is leading or (each.group is not None and each.group == leading.group)
    ]
    found = [(each.probability, each.best.fit) for each in group if each.best.fit is not None]
    # A group may lead by members that screening alone has weighed.
    return found or [(1.0, attribution.unexplained)]


def possible(attribution: Attribution) -> list[tuple[float, Fit]]:
    """The fits of all that may be, with their probabilities: no gap, every cause, the unknown.

    A number that does not hang on the cause, such as the tension, is averaged over them (Hoeting
    et al., Stat. Sci. 14, 1999); over the places too where a cause may act.
    """
    fits = [
        (attribution.no_gap_probability, attribution.baseline),
        (attribution.unexplained_probability, attribution.unexplained),
    ]
    for each in attribution.explanations:
        fits += _anywhere(each)
    return fits


def _anywhere(cause: Explanation) -> list[tuple[float, Fit]]:
    """The fits of a cause wherever it may act, with their shares of its probability."""
    found = [(each.log_evidence, each.posterior) for each in cause.variants]
    fitted = [(evidence, fit) for evidence, fit in found if fit is not None]
    if not fitted:
        return []
    share = normalised(np.array([evidence for evidence, _ in fitted]))
    return [(cause.probability * s, fit) for s, (_, fit) in zip(share, fitted, strict=True)]
