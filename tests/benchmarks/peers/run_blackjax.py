"""blackjax's adaptive tempered SMC: 2000 particles, effective share 0.5, 10 moves a stage.

The moves are random walks with the covariance of the particles (times 2.38^2/d, Roberts et al.
1997), tuned before every stage by `inner_kernel_tuning`. It evaluates all particles in one call.
"""

from __future__ import annotations

import os

os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"

import blackjax
import jax
import jax.numpy as jnp
import numpy as np
from blackjax.mcmc import random_walk
from blackjax.smc import extend_params
from blackjax.smc.resampling import systematic
from blackjax.smc.tuning.from_particles import particles_covariance_matrix
from problem import Outcome, Target, distinct, kish, moments, report

jax.config.update("jax_enable_x64", True)
_PARTICLES = 2000


def run(target: Target, seed: int) -> Outcome:
    """One run in the unit cube."""
    key, start = jax.random.split(jax.random.key(seed))
    particles = jax.random.uniform(start, (_PARTICLES, target.dimension))
    sampler = tempered(target, particles)
    state, step, log_evidence = sampler.init(particles), jax.jit(sampler.step), 0.0
    while state.sampler_state.tempering_param < 1:
        key, now = jax.random.split(key)
        state, info = step(now, state)
        log_evidence += float(info.log_likelihood_increment)
    weights = np.asarray(state.sampler_state.weights)
    theta = target.parameters(np.asarray(state.sampler_state.particles))
    effective = min(kish(weights), distinct(theta))
    return Outcome(log_evidence, None, effective, *moments(theta[:, 0], weights))


def tempered(target: Target, particles: jax.Array) -> blackjax.base.SamplingAlgorithm:
    """The sampler with moves whose covariance follows the particles."""

    def log_prior(unit: jax.Array) -> jax.Array:
        return jnp.where(((unit >= 0) & (unit <= 1)).all(), 0.0, -jnp.inf)

    def log_likelihood(unit: jax.Array) -> jax.Array:
        shape = jax.ShapeDtypeStruct((), jnp.float64)
        return jax.pure_callback(evaluate, shape, unit, vmap_method="expand_dims")

    def evaluate(unit: np.ndarray) -> np.ndarray:
        unit = np.asarray(unit)
        flat = target.log_likelihood(target.parameters(unit.reshape(-1, target.dimension)))
        return flat.reshape(unit.shape[:-1]).clip(-1e100)

    def proposal(points: jax.Array) -> dict[str, jax.Array]:
        covariance = 2.38**2 / target.dimension * particles_covariance_matrix(points)
        return extend_params({"proposal_root": jnp.linalg.cholesky(covariance)})

    kernel = random_walk.build_additive_step()

    def move(key, state, log_density, proposal_root):
        def step(key, position):
            return proposal_root @ jax.random.normal(key, position.shape)

        return kernel(key, state, log_density, step)

    return blackjax.inner_kernel_tuning(
        smc_algorithm=blackjax.adaptive_tempered_smc,
        logprior_fn=log_prior,
        loglikelihood_fn=log_likelihood,
        mcmc_step_fn=move,
        mcmc_init_fn=random_walk.init,
        resampling_fn=systematic,
        mcmc_parameter_update_fn=lambda key, state, info: proposal(state.particles),
        initial_parameter_value=proposal(particles),
        target_ess=0.5,
        num_mcmc_steps=10,
    )


if __name__ == "__main__":
    report("blackjax", run)
