"""pyOMA2's SSI and its automatic clustering, as its documentation shows them.

Output only: the accelerations, decimated so that the band fills two thirds of what is left. The
highest order is 100, enough for 50 modes; block rows are the default, or as many as that order
needs. The steps of the clustering are the defaults, with the band as limits; in a trial, none of
its presets found more.
"""

from __future__ import annotations

import math

import numpy as np
from given import Given, answer
from numpy.typing import NDArray
from pyoma2.algorithms import SSI
from pyoma2.algorithms.data.run_params import Clustering, Step1, Step2, Step3
from pyoma2.setup import SingleSetup

_HIGHEST_ORDER = 100
_LEAST_BLOCK_ROWS = 20


def run(given: Given) -> NDArray[np.float64]:
    """Natural frequencies in Hz."""
    setup = SingleSetup(given.acceleration.T, given.rate)
    factor = int(given.rate // (3 * given.band[1]))
    if factor > 1:
        setup.decimate_data(q=factor)
    rows = max(_LEAST_BLOCK_ROWS, 1 + math.ceil(_HIGHEST_ORDER / len(given.acceleration)))
    ssi = SSI(name="ssi", br=rows, ordmax=_HIGHEST_ORDER)
    setup.add_algorithms(ssi)
    setup.run_by_name("ssi")
    ssi.add_clustering(Clustering(name="own", steps=(Step1(), Step2(), Step3(freqlim=given.band))))
    ssi.run_clustering("own")
    return np.atleast_1d(ssi.result.clustering_results["own"].Fn).astype(float)


if __name__ == "__main__":
    answer("pyoma_2", run)
