"""Damping that rises with the level: a sign, beside the frequencies, that something slips or rubs.

In a linear hanger a mode's damping is the same at every level, but for what changes from test to
test: of all modes together (wind, warmth, how sensors and cables are tied on) and of each by
itself. Compared are

    ln damping = of the mode + of the test + of both [+ rise of the mode x level / highest level],

with normal terms and the unknown sizes integrated over a few values. It is a remark: cables and
their wind change damping too.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import scipy

from shm.gap.hypotheses.contract import Observations
from shm.gap.hypotheses.noise import same_mode
from shm.values import FloatArray

_SURE = 4.5  # log Bayes factor: three standard deviations
_ANY = 3.0  # judgement: of a mode, in logarithms, so wide that it says nothing
_OF_TESTS = 0.2
"""Judgement: damping of one cable in several tests of a day differs by 10 to 30 %."""
_OF_BOTH = (0.03, 0.1, 0.3)  # judgement: from the best identification to a mode that beats
_RISES = (0.1, 0.3, 1.0)
"""Judgement: a tenth more drowns in that; a joint that slips triples the damping at most."""
_LEAST_RATIO = 1.2  # of levels, as `shm.models.effects` asks


def remark_on_damping(observations: Observations) -> tuple[str, ...]:
    """Return a remark where damping surely rises with the level of excitation."""
    if log_rising(observations) < _SURE:
        return ()
    return ("Damping rises with the excitation amplitude: something slips or rubs.",)


def log_rising(observations: Observations) -> float:
    """Return the log Bayes factor of damping that rises with the level; 0 where unknown."""
    design, damping = observations.design, observations.damping
    known = np.flatnonzero(np.isfinite(damping).all(axis=1))
    test = design.frequency_test[known]
    level = design.amplitude[known]
    if not len(known) or level.max() <= _LEAST_RATIO * level.min():
        return 0.0
    value, sd = damping[known].T
    mode = same_mode(design)[np.ix_(known, known)]
    fixed = _ANY**2 * mode + _OF_TESTS**2 * np.equal.outer(test, test) + np.diag(sd**2)
    grown = level / level.max()
    uniform = np.outer(grown, grown)
    # What slips takes energy from every mode alike, from some more than from others, or from some.
    patterns = (uniform, uniform * (mode + 1) / 2, uniform * mode)
    of_both = np.eye(len(known))
    steady = [_log_density(value, fixed + scatter**2 * of_both) for scatter in _OF_BOTH]
    rising = [
        _log_density(value, fixed + scatter**2 * of_both + size**2 * pattern)
        for scatter, size, pattern in product(_OF_BOTH, _RISES, patterns)
    ]
    return float(
        scipy.special.logsumexp(rising)
        - scipy.special.logsumexp(steady)
        - np.log(len(_RISES) * len(patterns))
    )


def _log_density(value: FloatArray, covariance: FloatArray) -> float:
    """Return that of a normal law about an unknown mean, whose width is part of `covariance`."""
    factor = np.linalg.cholesky(covariance)
    white = np.linalg.solve(factor, value - value.mean())
    return float(-(white @ white) / 2 - np.log(np.diag(factor)).sum())
