"""JSON documents of the values: posteriors, drifts, alerts; unknown numbers are null in JSON.

What is read becomes a value by the types that its class declares: `value_of`, by cattrs. msgspec
has no hook for a built-in type, so a null could not be NaN.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass
from datetime import UTC, datetime
from difflib import get_close_matches
from typing import Any, Literal, TypeVar, get_args, get_origin

import cattrs
import numpy as np
from cattrs.cols import homogenous_tuple_structure_factory
from cattrs.gen import make_dict_structure_fn, make_hetero_tuple_structure_fn
from cattrs.v import transform_error

from shm.values import (
    NAN,
    WITHOUT_MODEL,
    Alert,
    Averaged,
    CreepRate,
    FloatArray,
    Limits,
    Posterior,
    Selection,
    Summary,
)
from shm.values.messages import Lead


def dump(document: object) -> str:
    """Return a document as JSON text: two-space indent, NaN as null."""
    return json.dumps(_clean(document), indent=2, allow_nan=False)


def compact(document: object) -> str:
    """Return the same without a blank, for what is kept ten thousandfold."""
    return json.dumps(_clean(document), separators=(",", ":"), allow_nan=False)


def _clean(node: object) -> object:
    """Return `node` with NaN as null and times as ISO texts, which JSON can hold."""
    if isinstance(node, Mapping):
        return {str(key): _clean(value) for key, value in node.items()}
    if isinstance(node, list | tuple):
        return [_clean(value) for value in node]
    if isinstance(node, datetime):
        return format_time(node)
    if isinstance(node, float | np.floating):
        return float(node) if math.isfinite(node) else None
    return int(node) if isinstance(node, np.integer) else node


def format_time(time: datetime | None) -> str | None:
    """Return a time as ISO 8601 in UTC with a trailing Z."""
    if time is None:
        return None
    return time.astimezone(UTC).isoformat().replace("+00:00", "Z")


def parse_time(text: str) -> datetime:
    """Return an ISO 8601 text as a UTC time; without zone it is UTC. Raises ValueError."""
    time = datetime.fromisoformat(text)
    return time.astimezone(UTC) if time.tzinfo else time.replace(tzinfo=UTC)


# ---------------------------------------------------------------- reading


T = TypeVar("T")
_Hook = Callable[[Any, Any], Any]


class ValidationError(ValueError):
    """A part of a document that is not the expected value; `key` is the one at fault."""

    def __init__(self, message: str, key: str):
        super().__init__(message)
        self.key = key


def value_of(kind: type[T], node: object, path: str = "", by: cattrs.Converter | None = None) -> T:
    """Return a part of a document as a value of a kind, its types checked; raises Misfit.

    `path` is where the part stands: of `tests[0]` it may say `tests[0].modes[1]: order = 2.5 is
    not a whole number`. `by` is a converter of `reader` with hooks of its own.
    """
    try:
        return (by or _READER).structure(node, kind)
    except (cattrs.BaseValidationError, ValueError) as error:
        message, _, at = transform_error(error, path, _message)[0].rpartition(" @ ")
    label, _, key = at.rpartition(".")
    raise ValidationError(f"{label and label + ': '}{key} {message}".strip(), key.partition("[")[0])


def _message(error: BaseException, _: object) -> str:
    return "is missing" if isinstance(error, KeyError) else str(error)


def number(node: Any) -> float:
    """Return a number of a document, where null is what is not known; raises ValueError."""
    if node is None:
        return NAN
    if isinstance(node, int | float) and not isinstance(node, bool):
        return float(node)
    raise ValueError(f"= {node!r} is not a number")


_LARGEST = 1e300  # technical: a square root or two of what follows from it must not overflow


def finite(node: Any) -> float:
    """Return a number that a person wrote, where null is what is not known; raises ValueError."""
    if node is None or (isinstance(node, int | float) and abs(node) < _LARGEST):
        return number(node)
    raise ValueError(f"= {node!r} is not a number")


def reader(
    number: Callable[[Any], float] = number, make: Callable[..., _Hook] = make_dict_structure_fn
) -> cattrs.Converter:
    """Return a converter of documents to frozen values, which takes nothing for what it is not.

    `number` says what a number is, `make` makes the hooks of our classes. By them null is NaN where
    a number is meant, and keys that the value does not have are left alone.
    """
    made = cattrs.Converter()
    made.register_structure_hook(float, lambda node, _: number(node))
    made.register_structure_hook(datetime, lambda node, _: _time(node))
    for plain, what in ((int, "a whole number"), (bool, "true or false"), (str, "a text")):
        made.register_structure_hook(plain, _plain(plain, what))
    made.register_structure_hook_factory(_is_of(np.ndarray), lambda _: _plain(np.ndarray, "arrays"))
    made.register_structure_hook_factory(_is_of(Literal), _one_of)
    made.register_structure_hook_factory(is_dataclass, _only(Mapping, "an object", make))
    made.register_structure_hook_factory(_is_of(tuple), _only(list | tuple, "a list", _row))
    return made


def _time(node: Any) -> datetime:
    try:
        return parse_time(node)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"= {node!r} is not an ISO 8601 time") from None


def _plain(kind: type, what: str) -> _Hook:
    """Return a hook that accepts values of a type; booleans are no integers."""

    def hook(node: Any, _: Any) -> Any:
        if isinstance(node, kind) and isinstance(node, bool) <= (kind is bool):
            return node
        raise ValueError(f"= {node!r} is not {what}")

    return hook


def _one_of(literal: Any) -> _Hook:
    known = get_args(literal)

    def hook(node: Any, _: Any) -> Any:
        if isinstance(node, str) and node in known:
            return node
        raise ValueError(f"= {node!r} is not one of {', '.join(known)}")

    return hook


def _only(of: Any, what: str, make: Callable[..., _Hook]) -> Callable[..., _Hook]:
    """Return a factory of hooks that check the type before cattrs structures the value."""

    def hook_for(kind: Any, by: cattrs.Converter) -> _Hook:
        take = make(kind, by)

        def hook(node: Any, _: Any) -> Any:
            if isinstance(node, of):
                return take(node, kind)
            raise ValueError(f"is not {what}")

        return hook

    return hook_for


def _row(kind: Any, by: cattrs.Converter) -> _Hook:
    long = get_args(kind)[1:] == (...,)
    make = homogenous_tuple_structure_factory if long else make_hetero_tuple_structure_fn
    hook: _Hook = make(kind, by)
    return hook


def _is_of(origin: Any) -> Callable[[Any], bool]:
    return lambda kind: get_origin(kind) is origin


_READER = reader()


_SIMILAR = 0.75  # of a key to another, from which on a slip of the hand is likelier than a key


def key_meant(key: str, known: Sequence[str]) -> str | None:
    """Return the key that a misspelt one stands for; None where it is known itself, or like none.

    Keys of others are left alone, but not those that somebody may think are read.
    """
    if key in known:
        return None
    return next(iter(get_close_matches(key, known, n=1, cutoff=_SIMILAR)), None)


# ---------------------------------------------------------------- posteriors

_OTHERWISE_IN_DOCUMENT = {
    "names", "units", "samples", "log_likelihood", "most_probable", "predicted", "baseline_check",
}  # fmt: skip
_PLAIN_FIELDS = tuple(
    each.name for each in fields(Posterior) if each.name not in _OTHERWISE_IN_DOCUMENT
)


def summary(samples: FloatArray, most_probable: float) -> dict[str, float]:
    """Return mean, standard deviation, quantiles and most probable value of samples (samples,)."""
    return {**asdict(Summary.of(samples)), "map": float(most_probable)}


def posterior_document(posterior: Posterior, probability: float = NAN) -> dict[str, Any]:
    """Return the document of `shm update --json`; `probability` is known after a selection only.

    A structure without a model has no tension: `tension_n` is null.
    """
    most_probable = dict(zip(posterior.names, posterior.most_probable, strict=True))
    tension = None
    if posterior.model != WITHOUT_MODEL:
        at = most_probable["theta_F"] * posterior.nominal_tension_n
        tension = summary(posterior.tension_n, at)
    return {
        "model": posterior.model,
        "tension_n": tension,
        "parameters": {
            name: summary(posterior.parameter(name), most_probable[name])
            | ({"unit": unit} if (unit := posterior.unit(name)) else {})
            for name in posterior.names
        },
        **{name: getattr(posterior, name) for name in _PLAIN_FIELDS},
        "probability": probability,
        "samples": len(posterior.samples),
        "predicted": [
            {
                "plane": p.plane,
                "order": p.order,
                "frequency_hz": {"mean": p.mean_hz, "sd": p.sd_hz},
                "measured_hz": p.measured_hz,
            }
            for p in posterior.predicted
        ],
        "caveats": posterior.caveats,
        "baseline_check": posterior.baseline_check and asdict(posterior.baseline_check),
    }


def selection_document(selection: Selection, limits: Limits | None = None) -> dict[str, Any]:
    """Return the document of `shm select --json`, with probabilities of the hanger's `limits`."""
    pairs = zip(selection.posteriors, selection.probabilities, strict=True)
    return {
        "models": [posterior_document(posterior, probability) for posterior, probability in pairs],
        "selected": selection.selected.model,
        "averaged": averaged_document(selection.averaged_with(limits)),
    }


def averaged_document(averaged: Averaged) -> dict[str, Any]:
    """Return the tension over all model classes, as reports and alerts lead with it."""
    return {**asdict(averaged), "caveats": list(averaged.caveats)}


# ---------------------------------------------------------------- watch


def creep_document(creep: CreepRate | None) -> dict[str, Any] | None:
    """Return the rate of creep, a fraction a year, and its sentence; None if unknown."""
    if creep is None or not creep.is_known:
        return None
    return {"mean": creep.mean, "sd": creep.sd, "words": creep.words}


def alert_document(alert: Alert) -> dict[str, Any]:
    """Return the document that a hook gets on its standard input, with its lead as fields."""
    tension = alert.tension and averaged_document(alert.tension)
    lead = Lead.of(alert.message)
    document = {
        "schema": "shm.alert/1",
        **asdict(alert),
        "tension": tension,
        **asdict(lead),
        "urgency": lead.urgency,
    }
    if alert.limit is None:
        del document["limit"]
    if alert.alerts:
        return {**document, "alerts": [alert_document(each) for each in alert.alerts]}
    del document["alerts"]
    return document
