"""Compute frequencies and shapes of a hanger from parameters, by each model class.

A new class is one file and one line in `MODELS`; a baseline with effects that a hanger's owner
adopted is made from its name (see `shm.models.one_hanger.adopted`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from shlex import quote

import numpy as np

from shm.errors import UsageError, suggest
from shm.models.classes.base import DESCRIPTION, PRIORS, THESIS, Model, held_otherwise
from shm.models.classes.registry import MODELS
from shm.models.one_hanger.adopted import (
    Adopted,
    AdoptedName,
    AdoptedOfThesis,
    is_adopted,
    with_parameters,
)
from shm.models.one_hanger.adopted import unfit as adopted_unfit
from shm.models.one_hanger.hanger_model import HangerModel
from shm.values import PLANES, FloatArray, Hanger, Posterior

AsMade = HangerModel
"""The name of the hanger's model in version 1.0."""
AS_DESCRIBED = "beam1"
"""The class that takes the ends as they are described, whatever holds them."""


def build(name: str, hanger: Hanger, priors: str = DESCRIPTION) -> Model:
    """Return class `name` of `hanger`, with the priors of its description or of the thesis.

    Raises UsageError for an unknown name, and where the hanger does not admit the class or the
    class cannot describe the hanger.
    """
    reason = _why_not(name, hanger)
    if reason:
        fitting, _ = applicable(hanger, list(MODELS))
        raise UsageError(
            f"model class {name} does not apply to hanger {hanger.id}: {reason}",
            remedy=f"Classes that apply: {', '.join(fitting) or 'none'}.",
        )
    return described(name, hanger, priors)


def check_baseline(name: str, hanger: Hanger) -> None:
    """Raise UsageError where the model class `name` is no baseline of a diagnosis of `hanger`.

    That is where `build` does, but that a diagnosis takes beam1 on any supports, and with no
    tension.
    """
    reason = _not_this_bar(name, hanger)
    if not reason and name != AS_DESCRIBED:
        reason = held_otherwise(hanger)
    if reason:
        raise UsageError(
            f"model class {name} is no baseline for hanger {hanger.id}: {reason}",
            remedy=f"Take another baseline, {AS_DESCRIBED} for instance.",
        )


def described(name: str, hanger: Hanger, priors: str = THESIS) -> Model:
    """Return the model class `name` of `hanger`, be it admitted or not.

    Raises UsageError for an unknown name, of a class or of priors.
    """
    if priors not in PRIORS:
        raise UsageError(f"unknown priors {priors!r}.", remedy=f"Known: {', '.join(PRIORS)}.")
    _refuse_unknown(name, hanger)
    if is_adopted(name):
        return Adopted(name, hanger) if priors == DESCRIPTION else AdoptedOfThesis(name, hanger)
    model = MODELS[name](hanger)
    return HangerModel(model) if priors == DESCRIPTION else model.of_the_thesis()


def class_of(posterior: Posterior, hanger: Hanger) -> Model:
    """Return the model class that a posterior's parameters are those of."""
    if is_adopted(posterior.model):
        return with_parameters(posterior.model, hanger, posterior.names, posterior.priors)
    return described(posterior.model, hanger, posterior.priors)


def class_units(name: str) -> Mapping[str, str]:
    """Return the units of the parameters of model class `name`, as far as its registry has them.

    Those of adopted effects depend on the hanger: the class itself (`class_of`) has them.
    """
    registered = MODELS.get(name.partition("+")[0], Model)
    return {**registered.units, "sigma": "1"}


def applicable(hanger: Hanger, names: Sequence[str]) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the model classes of `names` that apply to `hanger`, and why the others do not.

    Raises UsageError for an unknown name, be it in `names` or among the hanger's own.
    """
    reasons = {name: _why_not(name, hanger) for name in names}
    fitting = tuple(name for name, reason in reasons.items() if not reason)
    return fitting, {name: reason for name, reason in reasons.items() if reason}


def competing_names(hanger: Hanger, names: Sequence[str]) -> tuple[str, ...]:
    """Return the model classes of `names` that apply to a hanger; UsageError where none does."""
    fitting, reasons = applicable(hanger, names)
    if fitting:
        return fitting
    why = " ".join(f"{name}: {reason}" for name, reason in reasons.items())
    raise UsageError(
        f"no model class applies to hanger {hanger.id}. {why}".rstrip(),
        remedy="Name others in the setting models, or correct the hanger's description.",
    )


def _why_not(name: str, hanger: Hanger) -> str:
    """Return a sentence from its predicate on; empty where the class applies."""
    return _not_this_bar(name, hanger) or held_otherwise(hanger)


def _not_this_bar(name: str, hanger: Hanger) -> str:
    """Return the same, whatever holds the bar."""
    _refuse_unknown(name, hanger)
    if hanger.models and not {name, name.partition("+")[0]} & set(hanger.models):
        return f"the hanger's `models` admits {', '.join(hanger.models)} only."
    return adopted_unfit(name, hanger) if is_adopted(name) else MODELS[name].unfit(hanger)


def _refuse_unknown(name: str, hanger: Hanger) -> None:
    for each in (name, *hanger.models):
        if not is_adopted(each) and each not in MODELS:
            where = "" if each == name else f" in `models` of hanger {hanger.id}"
            raise UsageError(
                f"unknown model class {each!r}{where}.",
                remedy=f"{suggest(each, MODELS)}Known: {', '.join(MODELS)}; with an effect: "
                "beam1+point_mass@everywhere.",
            )


__all__ = [
    "AS_DESCRIBED",
    "DESCRIPTION",
    "MODELS",
    "PRIORS",
    "THESIS",
    "AdoptedName",
    "AsMade",
    "HangerModel",
    "Model",
    "applicable",
    "build",
    "check_baseline",
    "class_of",
    "class_units",
    "competing_names",
    "described",
    "is_adopted",
    "parameter_sets",
]


def parameter_sets(posterior: Posterior, model: Model) -> FloatArray:
    """Return the draws of a posterior as parameter sets (n, parameters) of `model`.

    Parameters that older posteriors do not have are at their usual value. Raises UsageError where
    the class has other parameters by now than the posterior was made with.
    """
    columns, lacking = [], []
    for name in model.parameter_names:
        if name in posterior.names:
            columns.append(posterior.parameter(name))
            continue
        try:
            columns.append(np.full(len(posterior.samples), model.usual(name)))
        except KeyError:
            lacking.append(name)
    if lacking:
        raise UsageError(
            f"the posterior of {posterior.model} was made without {', '.join(lacking)}.",
            remedy=f"Make it again: `shm ingest --again {quote(posterior.tests[-1])}`.",
        )
    return np.column_stack(columns)


def end_stiffness(posterior: Posterior, hanger: Hanger) -> dict[str, FloatArray]:
    """Return log10 of both ends' common stiffness in N m/rad (samples,), for planes with springs.

    It is 2/(1/k_deck + 1/k_arch), because frequencies alone cannot tell the ends apart. Raises
    UsageError where the class has other parameters by now than the posterior was made with.
    """
    model = class_of(posterior, hanger)
    deck, arch = model.springs_n_m_rad(parameter_sets(posterior, model))
    flexibility = 1 / deck + 1 / arch
    return {
        f"{plane}_end_stiffness": np.log10(2 / values)
        for plane, values in zip(PLANES, flexibility.T, strict=True)
        if np.all(values > 0)
    }
