"""Updates with frequencies good to 1e-5 to 1e-4: effective samples, and evidence between two seeds.

Random tensions and end springs, exact beams, orders 2 to 6 of both planes with normal errors.
Bounds: at least 200 effective samples in 95 % of the updates, log evidences within 0.3 in 95 % of
the pairs, and 84 % or more of the 90 % intervals hold the planted tension. Run:

    python tests/benchmarks/sharp_evidence.py --cases 32
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import begin
import numpy as np
from rich.progress import track

from shm.inference import UpdateOptions, update
from shm.models import THESIS, Model, build
from shm.values import PLANES, FloatArray, ModalTest, Mode, Posterior
from tests.helpers.hangers import HANGER_3

ERRORS = (1e-5, 3e-5, 1e-4)
ENOUGH, MOST_APART = 200, 0.3
LEAST_SHARE, LEAST_COVERED = 0.95, 0.84


@dataclass(frozen=True)
class Pair:
    """Two updates with one test by different seeds, their processor time, the planted theta_F."""

    posteriors: tuple[Posterior, Posterior]
    seconds: float
    truth: float

    @property
    def apart(self) -> float:
        """How far the log evidences differ."""
        one, other = self.posteriors
        return abs(one.log_evidence - other.log_evidence)

    def covered(self) -> list[bool]:
        """Whether each 90 % interval holds the truth."""
        drawn = [posterior.parameter("theta_F") for posterior in self.posteriors]
        intervals = [np.quantile(values, [0.05, 0.95]) for values in drawn]
        return [bool(low < self.truth < high) for low, high in intervals]


def modal_test(
    model: Model, theta: FloatArray, error: float, rng: np.random.Generator
) -> ModalTest:
    """Orders 2 to 6 of the exact beam with known fractional errors."""
    exact = model.frequencies_hz(theta[None], 6)[0, :, 1:]
    noisy = exact * (1 + error * rng.standard_normal(exact.shape))
    modes = tuple(
        Mode(plane, order, float(frequency), error * float(frequency))
        for plane, row in zip(PLANES, noisy, strict=True)
        for order, frequency in enumerate(row, start=2)
    )
    return ModalTest("sharp", modes, hanger=HANGER_3.id)


def pair(case: int, error: float) -> Pair:
    """One random hanger, updated twice."""
    rng, model = np.random.default_rng(case), build("beam2", HANGER_3, THESIS)
    theta = np.array([rng.uniform(0.6, 1.8), rng.uniform(0.97, 1.03), *rng.uniform(6, 9, 4)])
    test, started = modal_test(model, theta, error, rng), time.process_time()
    one, other = (update([test], model, UpdateOptions(1000, seed)) for seed in (1, 2))
    return Pair((one, other), (time.process_time() - started) / 2, float(theta[0]))


def faults(error: float, cases: int) -> list[str]:
    """Prints what came out for one error; the bounds that fail."""
    pairs = [pair(case, error) for case in track(range(cases), f"sd {error:g}", transient=True)]
    samples = [p.effective_sample_size for each in pairs for p in each.posteriors]
    apart = np.array([each.apart for each in pairs])
    covered = float(np.mean([each.covered() for each in pairs]))
    seconds = [each.seconds for each in pairs]
    print(
        f"sd {error:g}: effective samples {np.min(samples):.0f} at least, {np.median(samples):.0f} "
        f"in the median; log evidences {np.median(apart):.2f} apart, {apart.max():.2f} at most; "
        f"90 % interval covers {covered:.0%}; "
        f"{np.median(seconds):.2f} s of processor time, {max(seconds):.1f} at most"
    )
    checks = {
        "too few effective samples": np.mean(np.array(samples) >= ENOUGH) < LEAST_SHARE,
        "evidence differs between seeds": np.mean(apart <= MOST_APART) < LEAST_SHARE,
        "intervals too narrow": covered < LEAST_COVERED,
    }
    return [f"sd {error:g}: {fault}" for fault, found in checks.items() if found]


def main() -> None:
    """Runs the trial; exit code 1 where a bound fails."""
    arguments = begin.options(__doc__, cases=32)
    failed = [fault for error in ERRORS for fault in faults(error, arguments.cases)]
    if failed:
        raise SystemExit("; ".join(failed))


if __name__ == "__main__":
    main()
