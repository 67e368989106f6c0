"""What says beside the frequencies that something slips, rubs or knocks with the swing.

Damping above all: it rises with the level then.

In a linear hanger a mode's damping is the same at every level, but for what changes from test to
test: of all modes together (wind, warmth, how sensors and cables are tied on) and of each by
itself. Its level says nothing of a gap, since nobody knows it beforehand. Compared are

    ln damping = of the mode + of the test + of both [+ rise of the mode x level / highest level],

with normal terms and the unknown sizes integrated over a few values. Damping alone is no proof:
cables and their wind change it too, so its odds are held within twenty to one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import scipy

from shm.gap.contract import Hypothesis, Observations
from shm.gap.data_checks import SURE_COMMON_SDS, common_slope
from shm.gap.model_probabilities import NO_GAP, UNKNOWN, Family
from shm.gap.noise import same_mode
from shm.models.effects import EFFECTS
from shm.values import FloatArray, ModalTest
from shm.values.leading import MIN_NO_GAP_PROBABILITY

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
    found = [
        replace(kind, log_evidence=kind.log_evidence + odds, log_mimic=kind.log_mimic + odds)
        for kind in kinds
        for odds in [log_odds(rising, kind.best.hypothesis)]
    ]
    return tuple(sorted(found, key=lambda each: -(each.log_evidence + each.log_prior)))


def log_odds(rising: float, hypothesis: Hypothesis) -> float:
    """What damping adds to the log evidence of a hypothesis, against damping that does not rise.

    `rising` is its log Bayes factor. Of something unknown no one knows whether it takes energy:
    both are as likely.
    """
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
    level = design.amplitude[known]
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


_THAT_KNOCK = 2 / 7  # of the kinds of unknown effects there: guides with play and cracks
_SOUND_RATTLES = 1 / 200
"""Judgement: a sound hanger all of whose hits are disturbed at first and none later. It was none of
78 awkward records of `tests/worlds/recordings.py` (seeds from 9000 on)."""
_SOUND_IS_ASTRAY = 1 / 100
"""And one whose ring-downs begin as no sum of the modes found (1 of 97 awkward records, seeds 7000
to 7006), or whose slopes together are three standard deviations from zero (1 of 137)."""
_CONTRADICTED = 0.8 * MIN_NO_GAP_PROBABILITY
"""Judgement: what three standard deviations contradict is no answer, however poor the others."""


def acting(
    no_gap_probability: float, tests: Sequence[ModalTest], observations: Observations
) -> tuple[float, tuple[str, ...]]:
    """How probable it is, where nothing else is, that something knocks, slips, opens or rubs with
    the swing; with a remark for what is not said elsewhere.

    No gap is contradicted where a hanger at first does not ring as a bar does, and does once its
    swing has died away (`ModalTest.rattles_above`), where frequencies change alike within
    ring-downs, or where damping rises with the level, whatever the frequencies are.
    """
    sound, remarks = [], []
    rattle = [test for test in tests if math.isfinite(test.rattles_above)]
    if rattle:
        calm = any(test.amplitude <= test.rattles_above for test in rattle)
        sound.append(_SOUND_RATTLES if calm else _SOUND_IS_ASTRAY)
    slope, sd = common_slope(tests)
    if abs(slope) > SURE_COMMON_SDS * sd:
        sound.append(_SOUND_IS_ASTRAY)
    if log_rising(observations) > SURE_COMMON_SDS**2 / 2:
        sound.append(math.exp(-MOST))
        remarks.append("Damping rises with the excitation amplitude: something slips or rubs.")
    if not sound or not no_gap_probability:
        return 0.0, ()
    acts = UNKNOWN / NO_GAP * _THAT_KNOCK
    kept = min(min(sound) / (acts + min(sound)), _CONTRADICTED / no_gap_probability)
    return 1 - kept, tuple(remarks)
