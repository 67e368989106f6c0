"""The stiffness of a hanger's ends, as a posterior gives it."""

from __future__ import annotations

from shlex import quote

import numpy as np

from shm.errors import UsageError
from shm.models import class_of
from shm.values import PLANES, FloatArray, Hanger, Posterior


def end_stiffness(posterior: Posterior, hanger: Hanger) -> dict[str, FloatArray]:
    """log10 of the two ends' common stiffness in N m/rad (samples,), for planes with springs.

    It is 2/(1/k_deck + 1/k_arch), because frequencies alone cannot tell the ends apart. Raises
    UsageError where the class has other parameters by now than the posterior was made with.
    """
    model = class_of(posterior, hanger)
    lacking = [name for name in model.parameter_names if name not in posterior.names]
    if lacking:
        raise UsageError(
            f"the posterior of {posterior.model} was made without {', '.join(lacking)}.",
            remedy=f"Make it again: `shm ingest --again {quote(posterior.tests[-1])}`.",
        )
    theta = np.column_stack([posterior.parameter(name) for name in model.parameter_names])
    deck, arch = model.springs_n_m_rad(theta)
    flexibility = 1 / deck + 1 / arch
    return {
        f"{plane}_end_stiffness": np.log10(2 / values)
        for plane, values in zip(PLANES, flexibility.T, strict=True)
        if np.all(values > 0)
    }
