"""JSON documents of the values: posteriors, drifts, alerts; unknown numbers are null in JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from difflib import get_close_matches
from typing import Any

import numpy as np

from shm.values import (
    NAN,
    Alert,
    Averaged,
    Drift,
    FloatArray,
    Limits,
    Posterior,
    Selection,
    Summary,
)


def dump(document: object) -> str:
    """A document as JSON text: two-space indent, NaN as null."""
    return json.dumps(_clean(document), indent=2, allow_nan=False)


def _clean(node: object) -> object:
    """`node` with what JSON cannot hold replaced: NaN by null, times by ISO texts."""
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
    """A time as ISO 8601 in UTC with a trailing Z."""
    if time is None:
        return None
    return time.astimezone(UTC).isoformat().replace("+00:00", "Z")


def parse_time(text: str) -> datetime:
    """An ISO 8601 text as a UTC time; a text without zone is taken as UTC. Raises ValueError."""
    time = datetime.fromisoformat(text)
    return time.astimezone(UTC) if time.tzinfo else time.replace(tzinfo=UTC)


# ---------------------------------------------------------------- posteriors


_ALIKE = 0.75  # of a key to another, from which on a slip of the hand is likelier than a key


def key_meant(key: str, known: Sequence[str]) -> str | None:
    """The key that a misspelt one stands for; None where it is known itself, or like none.

    Keys of others are left alone, but not those that somebody may think are read.
    """
    if key in known:
        return None
    return next(iter(get_close_matches(key, known, n=1, cutoff=_ALIKE)), None)


def summary(samples: FloatArray, most_probable: float) -> dict[str, float]:
    """Mean, standard deviation, quantiles and most probable value of samples (samples,)."""
    return {**asdict(Summary.of(samples)), "map": float(most_probable)}


def posterior_document(posterior: Posterior, probability: float = NAN) -> dict[str, Any]:
    """The document of `shm update --json`; `probability` is known after a selection only."""
    most_probable = dict(zip(posterior.names, posterior.most_probable, strict=True))
    return {
        "model": posterior.model,
        "hanger": posterior.hanger,
        "tests": list(posterior.tests),
        "tension_n": summary(
            posterior.tension_n, most_probable["theta_F"] * posterior.nominal_tension_n
        ),
        "repeatability_sd_n": posterior.repeatability_sd_n,
        "nominal_tension_n": posterior.nominal_tension_n,
        "parameters": {
            name: summary(posterior.parameter(name), most_probable[name])
            for name in posterior.names
        },
        "log_evidence": posterior.log_evidence,
        "log_evidence_sd": posterior.log_evidence_sd,
        "probability": probability,
        "samples": len(posterior.samples),
        "effective_sample_size": posterior.effective_sample_size,
        "r_hat": posterior.r_hat,
        "evaluations": posterior.evaluations,
        "predicted": [
            {
                "plane": p.plane,
                "order": p.order,
                "frequency_hz": {"mean": p.mean_hz, "sd": p.sd_hz},
                "measured_hz": p.measured_hz,
            }
            for p in posterior.predicted
        ],
        "seconds": posterior.seconds,
        "seed": posterior.seed,
        "method": posterior.method,
        "priors": posterior.priors,
        "at_bounds": list(posterior.at_bounds),
        "misfit_percent": posterior.misfit_percent,
        "log_occam": posterior.log_occam,
        "tension_of_other_ends_n": posterior.tension_of_other_ends_n,
        "tension_of_other_orders_n": posterior.tension_of_other_orders_n,
        "description_off_sd": posterior.description_off_sd,
        "reading_off_sd": posterior.reading_off_sd,
        "caveats": list(posterior.caveats),
    }


def selection_document(selection: Selection, limits: Limits | None = None) -> dict[str, Any]:
    """The document of `shm select --json`, with probabilities of the hanger's `limits`."""
    pairs = zip(selection.posteriors, selection.probabilities, strict=True)
    return {
        "models": [posterior_document(posterior, probability) for posterior, probability in pairs],
        "selected": selection.selected.model,
        "averaged": averaged_document(selection.averaged(limits)),
    }


def averaged_document(averaged: Averaged) -> dict[str, Any]:
    """The tension over all model classes, as reports and alerts lead with it."""
    return {**asdict(averaged), "caveats": list(averaged.caveats)}


def averaged_from(document: Mapping[str, Any]) -> Averaged:
    """The same back from its document."""
    tension_n = {name: _known(value) for name, value in document["tension_n"].items()}
    names = ("repeatability_sd_n", "probability_above_limit", "probability_slack")
    numbers = {name: _known(document[name]) for name in names}
    return Averaged(Summary(**tension_n), caveats=tuple(document["caveats"]), **numbers)


def _known(value: float | None) -> float:
    return NAN if value is None else float(value)


# ---------------------------------------------------------------- drift


def drift_document(drift: Drift) -> dict[str, Any]:
    """One row of `shm drift --json`."""
    return asdict(drift)


def alert_document(alert: Alert) -> dict[str, Any]:
    """What a hook gets on its standard input."""
    tension = alert.tension and averaged_document(alert.tension)
    document = {"schema": "shm.alert/1", **asdict(alert), "tension": tension}
    if alert.alerts:
        return {**document, "alerts": [alert_document(each) for each in alert.alerts]}
    del document["alerts"]
    return document
