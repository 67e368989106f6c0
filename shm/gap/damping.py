"""What damping says beside the frequencies: it rises with the level where something slips or rubs.

In a linear hanger a mode's damping is the same at every level, but for what changes from test to
test: of all modes together (wind, warmth, how sensors and cables are tied on) and of each by
itself. Its level says nothing of a gap, since nobody knows it beforehand. Compared are

    ln damping = of the mode + of the test + of both [+ rise of the mode x level / highest level],

with normal terms and the unknown sizes integrated over a few values. Damping alone is no proof:
cables and their wind change it too, so its odds are held within twenty to one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import scipy

from shm.gap.contract import Hypothesis, Observations
from shm.gap.model_probabilities import Family
from shm.gap.noise import same_mode
from shm.models.effects import EFFECTS
from shm.values import FloatArray

MOST = float(np.log(20))
_ANY = 3.0  # judgement: of a mode, in logarithms, so wide that it says nothing
_OF_TESTS = 0.2
"""Judgement: damping of one cable in several tests of a day differs by 10 to 30 %."""
_OF_BOTH = (0.03, 0.1, 0.3)  # judgement: from the best identification to a mode that beats
_RISES = (0.1, 0.3, 1.0)
"""Judgement: a tenth more drowns in that; a joint that slips triples the damping at most."""
_LEAST_RATIO = 1.2  # of levels, as `shm.models.effects` asks


def with_damping(observations: Observations, kinds: Sequence[Family]) -> tuple[Family, ...]:
    """Families with what damping says of each, the likeliest first."""
    rising = log_rising(observations)
    told = [(kind, _odds(rising, kind.best.hypothesis)) for kind in kinds]
    found = [
        replace(kind, log_evidence=kind.log_evidence + odds, log_mimic=kind.log_mimic + odds)
        for kind, odds in told
    ]
    return tuple(sorted(found, key=lambda each: -(each.log_evidence + each.log_prior)))


def log_odds(observations: Observations, hypothesis: Hypothesis) -> float:
    """What damping adds to the log evidence of a hypothesis, against damping that does not rise.

    Of something unknown no one knows whether it takes energy: both are as likely.
    """
    return _odds(log_rising(observations), hypothesis)


def _odds(rising: float, hypothesis: Hypothesis) -> float:
    rises = any(EFFECTS[name].dissipates for name in hypothesis.names)
    if not (rises or hypothesis.flexible):
        return 0.0
    odds = float(np.clip(rising, -MOST, MOST))
    return odds if rises else float(np.logaddexp(odds, 0.0) - np.log(2))


def log_rising(observations: Observations) -> float:
    """Log Bayes factor of a damping that rises with the level; 0 where the tests cannot tell."""
    design, damping = observations.design, observations.damping
    known = np.flatnonzero(np.isfinite(damping).all(axis=1))
    test = design.frequency_test[known]
    level = np.array([each.amplitude for each in design.conditions])[test]
    if not len(known) or level.max() <= _LEAST_RATIO * level.min():
        return 0.0
    value, sd = damping[known].T
    mode = same_mode(design)[np.ix_(known, known)]
    fixed = _ANY**2 * mode + _OF_TESTS**2 * np.equal.outer(test, test) + np.diag(sd**2)
    grown = level / level.max()
    alike = np.outer(grown, grown)
    # What slips takes energy from every mode alike, from some more than from others, or from some.
    patterns = (alike, alike * (mode + 1) / 2, alike * mode)
    of_both = np.eye(len(known))
    steady = [_log_density(value, fixed + own**2 * of_both) for own in _OF_BOTH]
    rising = [
        _log_density(value, fixed + own**2 * of_both + size**2 * pattern)
        for own, size, pattern in product(_OF_BOTH, _RISES, patterns)
    ]
    return float(
        scipy.special.logsumexp(rising)
        - scipy.special.logsumexp(steady)
        - np.log(len(_RISES) * len(patterns))
    )


def _log_density(value: FloatArray, covariance: FloatArray) -> float:
    """Normal, about a common mean that nobody knows (its own width is part of `covariance`)."""
    factor = np.linalg.cholesky(covariance)
    white = np.linalg.solve(factor, value - value.mean())
    return float(-(white @ white) / 2 - np.log(np.diag(factor)).sum())
