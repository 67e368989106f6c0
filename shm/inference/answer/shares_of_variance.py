"""Shares of the tension's variance that the inclination and the ends explain."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shm.inference.problem.described import DescribedCoordinates
from shm.inference.problem.hanger_problem import Problem
from shm.models.one_hanger.terms import FITTING_MASS, FITTING_STIFFNESS, INCLINATION
from shm.values import NAN, FloatArray, Posterior

_OF_ENDS = (*FITTING_STIFFNESS, FITTING_MASS)


def with_shares(problem: Problem, posterior: Posterior) -> Posterior:
    """Return the posterior with the shares of variance of what the owner did not state."""
    coordinates, hanger = problem.coordinates, problem.model.hanger
    if not isinstance(coordinates, DescribedCoordinates):
        return posterior
    z = coordinates.places(posterior.samples[:, :-1])
    log_tension = np.log(posterior.samples[:, 0])
    scores = coordinates.asked_of_description(z)
    terms = {term.name: scores[:, [k]] for k, term in enumerate(coordinates.terms)}
    lean, ends = NAN, NAN
    if INCLINATION in terms and math.isnan(hanger.inclination_deg):
        lean = explained_share(log_tension, terms[INCLINATION])
    of_ends = [z[:, coordinates.ends_at], *(terms[name] for name in _OF_ENDS if name in terms)]
    if not hanger.ends and sum(each.shape[1] for each in of_ends):
        ends = explained_share(log_tension, np.hstack(of_ends))
    return replace(posterior, inclination_share_of_variance=lean, ends_share_of_variance=ends)


def explained_share(values: FloatArray, scores: FloatArray) -> float:
    """Return the part of the variance of `values` (n,) that `scores` (n, k) explain.

    They do so by a polynomial of second degree: of two springs in a row it is often their
    difference that counts, whichever is the stiffer. Adjusted for the number of draws, the part is
    0 on average for scores that have nothing to do with the values.
    """
    n, k = scores.shape
    pairs = [scores[:, i] * scores[:, j] for i in range(k) for j in range(i + 1)]
    columns = np.column_stack([np.ones(n), scores, *pairs])
    fit = np.linalg.lstsq(columns, values, rcond=None)[0]
    left = np.var(values - columns @ fit) / np.var(values)
    return float(1 - left * (n - 1) / (n - columns.shape[1]))
