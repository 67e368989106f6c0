"""The judgements and technical limits of the checks of a test, in one table."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Hold each limit with its unit and reason; where no source is named it is a judgement."""

    # ---- bar evidence
    looser: tuple[float, ...] = 0.02, 0.05, 3e-4, 0.5, 0.0
    altered: tuple[float, ...] = 0.01, 0.40, 1e-2, 0.7, 0.0
    test_errors: tuple[tuple[float, float], ...] = (
        (0.55, 3e-4),
        (0.35, 1e-3),
        (0.08, 3e-3),
        (0.02, 0.03),
    )
    # Weights and standard deviations of ln f of each mode beyond the stated ones: of one test
    # against another (0.03: a change of no known kind), and of a bar against its description.
    bar_errors: tuple[tuple[float, float], ...] = (
        (0.3, 1e-3),
        (0.45, 3e-3),
        (0.2, 1e-2),
        (0.05, 0.03),
    )
    # Of the variance of a bar's errors, what goes together in neighbouring orders, and how far in
    # ln of the order: fittings, end zones and sensors raise or lower many modes alike.
    together: float = 0.9
    along_orders: float = 0.7
    # Share by which a fitted bar mistakes the shift of a frequency.
    off_shift: float = 0.01
    # Probability that a mode is another peak or has another's order, within 20 % to either side.
    mistaken: float = 0.02
    mistaken_density: float = 2.5
    most_mistaken: int = 2
    # Probability that something was hung on the bar, and the error of each mode besides.
    mass: float = 0.01
    mass_error: float = 2e-3

    # ---- bars
    # Prior probabilities that a test is not what it is filed as. Of numbers keyed in once and not
    # checked 1 to 2 % are wrong (Barchard and Pace 2011, Computers in Human Behavior 27, 1834); the
    # others are rarer: each needs a wrong setting, not a wrong digit.
    swap: float = 0.015
    unknown_bar: float = 0.003
    time_base: float = 0.004
    planes_exchanged: float = 0.003
    # Probability of not being what it is filed as from which a test is doubted.
    doubted_from: float = 0.5
    # Of a wrong time base: the rate of every second sample, a decade, 1000 for 1024.
    factors: tuple[float, ...] = (2.0, 0.5, 10.0, 0.1, 1.024, 1 / 1.024)
    # 20 to 1 (judgement): where a described hanger is that near to a bar that nobody described, the
    # person who looks is better served with its number.
    clearly_nats: float = 3.0

    # ---- copies
    # Of each shape, from its reach before its place up to its reach after it.
    samples: int = 32
    # Shapes: some 3 kB a channel, and 60 kB a recording at most.
    most_a_channel: int = 48
    most: int = 800
    # Samples to either side that the choice of a place looks at; the mean of as many is taken off.
    half: int = 32
    place: int = 2  # columns of the marks, after the channel and the number of its samples
    reach: int = 3
    # Shapes that must be moved alike: a single one may look like another by chance.
    least: int = 2
    # Of the shapes that both should have; numbers rounded to four digits keep 90 % of them.
    share: float = 0.75
    # 1 - correlation of two shapes of copies at most. Numbers rounded to four digits come to 8e-9
    # in the median and stay below 4.5e-8 in 2,500 shapes. It would have to be above 1e-4 for any of
    # 780 pairs of simulated tests of one hanger with a single hit each to pass as copies, or of 780
    # with three, or of the five real hits in shared/data; 3e-6 with a tenth of the noise, 0.2
    # mm/s2. With a hundredth, which no sensor has, the closest of 378 pairs came to 5.6e-8: its
    # hits fell at the same fraction of a sample.
    same: float = 5e-8
    roughly: float = 1e-4  # single precision errs by far less
    # 1 - correlation of two shapes in one channel, at which neither tells anything: a hum, or a
    # mode that rings alone without noise, comes again in other tests, too.
    repeated: float = 1e-5
    most_named: int = 3  # recordings in one message
    # Of the shapes of a channel must come once: else those of another reach are only not seen
    # twice. It is 0.1 of a hum at most, and all of each simulated or real response that was tried.
    telling: float = 0.25


LIMITS = Limits()
