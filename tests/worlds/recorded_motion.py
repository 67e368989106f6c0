"""How the structures of `recordings` move: exact ring-downs after hits, and the answer to noise.

Each mode is q'' + 2 z w q' + w^2 q = f, carried as a complex eta with eta' = s eta + f,
s = -z w + i w_d, so that q = Im(eta) / w_d and q'' = Im(s^2 eta) / w_d + f.  A half-sine contact
has a closed form; between contacts eta only turns and decays.  Where the frequency depends on the
amplitude, w(a) = w (1 + c (a / a_ref)^p), the turning has a closed form too, because a decays
exponentially: the method of averaging (Nayfeh and Mook 1979, ch. 2), to first order in c.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
BLOCK = 512  # samples of a turning that are computed by one exponential and one product
LOST = 25.0  # decay constants: exp(-25) is far below the last bit of any logger


@dataclass(frozen=True)
class Push:
    """What sets the modes off: a half-sine contact, or (contact 0) a release of a static pull.

    `modal` (modes,) is the force's peak, in N, times the shape where it acts.
    """

    at_s: float
    contact_s: float
    modal: Array


@dataclass(frozen=True)
class Law:
    """Relative change of the frequency at the largest amplitude of the record, per mode."""

    change: Array
    power: int = 1


@dataclass(frozen=True)
class Modes:
    """Frequency in Hz (undamped) and damping ratio, each (modes,)."""

    frequency_hz: Array
    damping: Array

    @property
    def poles(self) -> Complex:
        w = 2 * np.pi * self.frequency_hz
        return np.asarray(-self.damping * w + 1j * w * np.sqrt(1 - self.damping**2))


def contact(pole: complex, contact_s: float, since_s: Array) -> Complex:
    """eta after a half-sine of peak 1 has acted for `since_s` (at most its contact time)."""
    turn = np.pi / contact_s
    t = np.minimum(since_s, contact_s)
    answer = turn * np.exp(pole * t) - pole * np.sin(turn * t) - turn * np.cos(turn * t)
    return np.asarray(answer / (pole**2 + turn**2))


def released(pole: complex) -> complex:
    """eta after a static pull of 1 N (modal) is let go: q = 1 / w^2 and q' = 0."""
    return complex((-pole.real + 1j * pole.imag) / abs(pole) ** 2)


def _turning(pole: complex, step_s: float, count: int) -> Complex:
    inner = np.exp(pole * step_s * np.arange(BLOCK))
    outer = np.exp(pole * step_s * BLOCK * np.arange(-(-count // BLOCK)))
    return np.asarray(np.outer(outer, inner).reshape(-1)[:count])


class Ringing:
    """The ring-downs of all modes on a grid of times, one mode at a time to keep memory small."""

    def __init__(self, modes: Modes, pushes: Sequence[Push], law: Law | None = None) -> None:
        self.modes, self.pushes = modes, sorted(pushes, key=lambda p: p.at_s)
        self.law = law or Law(np.zeros(len(modes.damping)))
        self.reference = np.zeros(len(modes.damping))
        peaks = [max(self._peaks(k), default=0.0) for k in range(len(modes.poles))]
        self.reference = np.array(peaks)

    def _peaks(self, k: int) -> list[float]:
        return [abs(start) for _, _, start in self._stretches(k, np.inf)]

    def _phase(self, k: int, amplitude: float, since_s: Array) -> Array:
        """How far the turning runs ahead of the linear one, in rad."""
        if self.reference[k] == 0 or self.law.change[k] == 0:
            return np.zeros_like(since_s)
        pole, p = self.modes.poles[k], self.law.power
        rate = self.law.change[k] * pole.imag * (amplitude / self.reference[k]) ** p
        return np.asarray(rate * -np.expm1(p * pole.real * since_s) / (-p * pole.real))

    def _stretches(self, k: int, until_s: float) -> Iterator[tuple[float, float, complex]]:
        """Free stretches (begin, end, eta at the begin)."""
        pole, eta, since = complex(self.modes.poles[k]), 0j, -np.inf
        ends = [p.at_s for p in self.pushes[1:]] + [until_s]
        for push, end in zip(self.pushes, ends, strict=True):
            begin = push.at_s + push.contact_s
            if np.isfinite(since):
                ahead = float(self._phase(k, abs(eta), np.array([begin - since]))[0])
                eta *= np.exp(pole * (begin - since) + 1j * ahead)
            if push.contact_s > 0:
                eta += push.modal[k] * contact(pole, push.contact_s, np.array([push.contact_s]))[0]
            else:
                eta += push.modal[k] * released(pole)
            since = begin
            yield begin, end, complex(eta)

    def eta(self, k: int, start_s: float, step_s: float, count: int) -> Complex:
        """eta of mode `k` at start + step * (0 .. count - 1)."""
        pole = complex(self.modes.poles[k])
        result = np.zeros(count, complex)
        for push, (begin, _, first) in zip(
            self.pushes, self._stretches(k, start_s + count * step_s), strict=True
        ):
            i = max(0, int(np.ceil((begin - start_s) / step_s)))
            if i < count:
                length = min(count - i, int(LOST / (-pole.real * step_s)) + 1)
                shift = start_s + i * step_s - begin
                turned = first * np.exp(pole * shift) * _turning(pole, step_s, length)
                if self.law.change[k] != 0:
                    since = shift + step_s * np.arange(length)
                    turned = turned * np.exp(1j * self._phase(k, abs(first), since))
                result[i:] = 0
                result[i : i + length] = turned
            self._during(result, k, push, start_s, step_s)
        return result

    def _during(self, result: Complex, k: int, push: Push, start_s: float, step_s: float) -> None:
        """Within the contact what rang before goes on, and the force's part is added."""
        pole = complex(self.modes.poles[k])
        i = max(0, int(np.ceil((push.at_s - start_s) / step_s)))
        j = min(len(result), int(np.ceil((push.at_s + push.contact_s - start_s) / step_s)))
        if i >= j:
            return
        since = start_s + step_s * np.arange(i, j) - push.at_s
        before = result[i - 1] if i > 0 else 0j
        carried = before * np.exp(pole * step_s * np.arange(1, j - i + 1))
        result[i:j] = carried + push.modal[k] * contact(pole, push.contact_s, since)

    def acceleration(self, k: int, start_s: float, step_s: float, count: int) -> Array:
        """q'' without the force's own share f, which `band_limited` gives."""
        pole = complex(self.modes.poles[k])
        return np.asarray((pole**2 * self.eta(k, start_s, step_s, count)).imag / pole.imag)

    def accelerations_after(self, k: int) -> tuple[complex, ...]:
        """q'' of mode `k` as a phasor, at the end of each push."""
        pole = complex(self.modes.poles[k])
        return tuple(pole**2 * eta / pole.imag for _, _, eta in self._stretches(k, np.inf))

    def mean_frequency_hz(self, k: int, until_s: float) -> float:
        """The undamped frequency, averaged over the ring-downs with the squared amplitude."""
        pole, p = complex(self.modes.poles[k]), self.law.power
        plain = bent = 0.0
        for begin, end, first in self._stretches(k, until_s):
            if end <= begin:
                continue

            def decay(power: int, span: float = end - begin) -> float:
                return float(-np.expm1(power * pole.real * span) / (-power * pole.real))

            plain += abs(first) ** 2 * decay(2)
            bent += abs(first) ** (2 + p) * decay(2 + p)
        if plain == 0 or self.reference[k] == 0:
            return float(self.modes.frequency_hz[k])
        shift = self.law.change[k] * bent / plain / self.reference[k] ** p
        return float(self.modes.frequency_hz[k] * (1 + shift))


def band_limited(push: Push, start_s: float, step_s: float, count: int) -> tuple[int, Array]:
    """A half-sine of peak 1 as a grid of this step can hold it: first index, values.

    The contact may be shorter than a step; its impulse must not depend on where the samples fall.
    So it passes a windowed sinc at 0.45 of the grid's rate before it is sampled.
    """
    reach, cut = 24, 0.45
    first = int(np.floor((push.at_s - start_s) / step_s)) - reach
    last = int(np.ceil((push.at_s + push.contact_s - start_s) / step_s)) + reach
    first, last = max(first, 0), min(last, count)
    x, weight = np.polynomial.legendre.leggauss(40 + 2 * int(push.contact_s / step_s))
    tau = push.contact_s * (x + 1) / 2
    steps = (start_s + step_s * np.arange(first, last)[:, None] - push.at_s - tau) / step_s
    window = np.where(np.abs(steps) < reach, np.cos(np.pi * steps / (2 * reach)) ** 2, 0)
    kernel = 2 * cut * np.sinc(2 * cut * steps) * window
    force = np.sin(np.pi * tau / push.contact_s) * weight * push.contact_s / 2
    return first, np.asarray(kernel @ force / step_s)


def coloured(rng: np.random.Generator, count: int, step_s: float, density: Array) -> Array:
    """Gaussian noise of the one-sided amplitude density (rfft lines,) in unit/sqrt(Hz)."""
    lines = rng.standard_normal((2, count // 2 + 1))
    spectrum = (lines[0] + 1j * lines[1]) * density * np.sqrt(count / (4 * step_s))
    spectrum[0] = 0
    return np.asarray(fft.irfft(spectrum, count))


def answer(modes: Modes, k: int, force: Array, step_s: float) -> Array:
    """q'' of mode `k` under a modal force (count,), as if it went on for ever (periodically)."""
    w = 2 * np.pi * fft.rfftfreq(len(force), step_s)
    own = 2 * np.pi * modes.frequency_hz[k]
    transfer = -(w**2) / (own**2 - w**2 + 2j * modes.damping[k] * own * w)
    return np.asarray(fft.irfft(fft.rfft(force) * transfer, len(force)))
