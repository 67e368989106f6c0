"""The registry of model classes: a new one is one file and one line here.

Packages from outside add theirs by the entry points `shm.models` (`shm.models.plug_ins`).
"""

from __future__ import annotations

from shm.errors import UsageError, suggest
from shm.models.classes.base import Model, held_otherwise
from shm.models.classes.beam import Beam1, Beam2, Beam3
from shm.models.classes.solid import S1, S2, Solid0, Solid1, Solid2
from shm.models.plug_ins import MODELS_GROUP, members_with_plug_ins
from shm.values import Hanger

_BUILT_IN = (Beam1, Beam2, Beam3, S1, S2, Solid0, Solid1, Solid2)
MODELS: dict[str, type[Model]] = members_with_plug_ins(
    MODELS_GROUP, {model.name: model for model in _BUILT_IN}, Model
)


def registered(name: str, hanger: Hanger) -> Model:
    """Return the registered class `name` of `hanger`, be it admitted there or not.

    Raises UsageError for an unknown name, and where the class cannot describe the hanger.
    """
    if name not in MODELS:
        remedy = f"{suggest(name, MODELS)}Known: {', '.join(MODELS)}."
        raise UsageError(f"unknown model class {name!r}.", remedy=remedy)
    reason = MODELS[name].unfit(hanger) or held_otherwise(hanger)
    if reason:
        raise UsageError(
            f"model class {name} does not apply to hanger {hanger.id}: {reason}",
            remedy="Take another class, or correct the hanger's description.",
        )
    return MODELS[name](hanger)
