"""A model class as the baseline of a diagnosis, told in the terms of the general hanger model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.errors import UsageError
from shm.models.base import Model
from shm.models.beam import Beam
from shm.models.effects.base import Parameter
from shm.models.hanger import PhysicalHanger, solve
from shm.models.registry import MODELS
from shm.models.solid import S2
from shm.values import NAN, FloatArray, Hanger

_LENGTH = "theta_L"
_NOWHERE = np.empty(0)


class Baseline:
    """The model class `name` of `hanger`, its length that of the description.

    The beams are cases of the general model. Of the others it takes the frequencies and, for what
    effects change and for shapes, a bar on equivalent end springs.
    """

    def __init__(self, name: str, hanger: Hanger):
        self.name, self.hanger = name, hanger
        if reason := MODELS[name].unfit(hanger):
            raise UsageError(
                f"model class {name} is no baseline for hanger {hanger.id}: {reason}",
                remedy="Take another baseline, beam1 for instance.",
            )
        self._model = MODELS[name](hanger)
        bounds = self._model.bounds
        self.parameters = tuple(
            Parameter(key, _unit(key), lower, upper, NAN, f"the prior of model class {name}")
            for key, (lower, upper) in bounds.items()
            if key != _LENGTH
        )
        self._last: tuple[bytes, int, FloatArray] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(parameter.name for parameter in self.parameters)

    def physical(self, theta: FloatArray, sensors: int) -> PhysicalHanger:
        """The hangers of `theta` (n, parameters) before any effect, with that many sensors."""
        whole = self._whole(theta)
        tension_n = theta[:, self.names.index("theta_F")] * self.hanger.nominal_tension_n
        clamped = PhysicalHanger.clamped(self.hanger, tension_n, sensors)
        deck_m, arch_m = _ends_m(self._model)
        bar = replace(
            clamped,
            deck_end_m=np.full(len(theta), deck_m),
            arch_end_m=np.full(len(theta), arch_m),
        )
        return bar.on_springs(self._model.springs_n_m_rad(whole))

    def ratio(self, theta: FloatArray, modes: int) -> FloatArray:
        """The class's frequencies over those of the general model (n, 2, modes)."""
        if isinstance(self._model, Beam):
            return np.ones((len(theta), 2, modes))
        key = theta.tobytes()
        if self._last is None or self._last[:2] != (key, modes):
            general = solve(self.physical(theta, 0), modes, _NOWHERE, shapes=False)
            found = self._model.frequencies_hz(self._whole(theta), modes)
            self._last = key, modes, found / general.frequency_hz
        return self._last[2]

    def _whole(self, theta: FloatArray) -> FloatArray:
        """As the class takes them, with its length at the description's."""
        columns = dict(zip(self.names, theta.T, strict=True))
        one = np.ones(len(theta))
        return np.column_stack([columns.get(key, one) for key in self._model.parameter_names])


def _ends_m(model: Model) -> tuple[float, float]:
    """Where the class's bar begins and ends: s2 has the rod between the plates alone."""
    plate = model.hanger.plate
    plate_m = plate.length_m if isinstance(model, S2) and plate is not None else 0.0
    return plate_m, model.hanger.length_m - plate_m


def _unit(name: str) -> str:
    return "" if name.startswith("theta") else "N m/rad"
