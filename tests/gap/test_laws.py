"""An allowance for the error of an effect's own law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.contract import Fit, Hypothesis
from shm.gap.fit import baseline_fit, fitted
from shm.gap.laws import EXACT, by_its_laws
from shm.gap.problem import GapProblem
from shm.models.effects import EFFECTS
