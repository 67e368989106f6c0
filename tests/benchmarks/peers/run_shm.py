"""Ours: `shm.update`, default settings (1000 samples)."""

from __future__ import annotations

from problem import Outcome, Target, moments, report

from shm.inference import UpdateOptions, update


def run(target: Target, seed: int) -> Outcome:
    """One run."""
    posterior = update(target.tests, target.model, UpdateOptions(seed=seed))
    target.evaluations += posterior.evaluations
    return Outcome(
        posterior.log_evidence,
        posterior.log_evidence_sd,
        posterior.effective_sample_size,
        *moments(posterior.samples[:, 0]),
    )


if __name__ == "__main__":
    report("shm", run)
