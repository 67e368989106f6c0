"""The judgements and technical limits of permanent sensors' windows, in one table."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Hold each limit with its unit and reason; where no source is named it is a judgement."""

    # ---- close modes
    # technical: lines are averaged over so much of a mode's half bandwidth, where T gives more.
    bin: float = 0.25
    # judgement: weak knowledge of the logarithms of damping and floor from before, of the
    # correlation of two modes, and of the slope of the force and of what other modes, moved by the
    # same wind, add to a mode's tails: R times what its own stiffness would, R of 3 to 5, is a
    # slope of 2 R; of shapes as identified from one window, three degrees.
    damping_sd: float = 0.7
    slope_sd: float = 10.0
    tilt_sd: float = 0.05
    coherence_sd: float = 0.5
    floor_sd: float = 2.0
    most_coherent: float = 0.9
    same_direction: float = 0.1  # judgement: modes of nearer shapes differ by frequency alone
    most_step: float = 1.0  # technical: a half bandwidth, and a factor of e

    # ---- pooling
    # judgement: usual deviations; of 144 windows of a day one in a hundred days by chance.
    outlying: float = 4.0
    usual_sd: float = 1.4826  # of the median absolute deviation of normal numbers
    least_to_judge: int = 3  # technical: two windows do not say which of them is wrong
    # judgement: of the windows, in which a mode must have been found: one that is seen now and then
    # is seen when chance raises it.
    least_share: float = 0.2
    least_to_regress: int = 12  # judgement: six windows a slope
    # judgement: of the level (a fraction) and the temperature (degrees), for a slope to matter.
    least_spread: tuple[float, ...] = 0.1, 0.5
    # technical: their scatter knows a standard deviation to a third, and one of four windows
    # forgets what comes before it.
    least_batches: int = 6
    least_to_batch: int = 24
    # Of a frequency: what stays the same in every window: close modes, softening joints. Measured
    # by `tests/benchmarks/stream_windows.py --seed 20 --seeds 4 --hours 3` (62 modes).
    repeats: float = 6e-5

    # ---- sensor health
    # judgement: of the full scale, and the share of samples beyond; 0.6 s of ten minutes.
    at_full_scale: float = 0.99
    clipped: float = 1e-3
    hour: int = 6  # windows: a quiet quarter of an hour hides the modes of a sound sensor, too
    # judgement: six hours of windows, which have met more than one level of motion
    least_before: int = 36
    # Of the lowest level before: no motion is less than the noise of the sensor itself, which of a
    # sound one changes by 1 dB between -20 and +40 degrees (with the root of the absolute
    # temperature), and hides the modes once the motion is as low; this is 6 dB.
    fallen: float = 0.5
    least_modes: int = 3  # judgement: one mode or two agree with an exchange by chance
    # judgement: share of the motion that is explained with the exchange, and how much less without.
    as_known: float = 0.9
    gain: float = 0.15
    within: float = 0.02  # of a frequency: what temperature moves, and the other plane's mode

    # ---- spectrum
    # technical: of a grid of frequencies, a fifth of the peaks' width at 0.5 % of damping
    step: float = 2e-4
    # judgement: of a mode whose damping is not known; bars have 0.001, strands 0.005.
    damping: float = 0.003
    # technical: positions are read off a tape.
    same_place_m: float = 0.01
    mixed: float = 0.4  # judgement: of the motion in its own plane; sensors turned by 22 degrees
    smoothed: int = 16  # technical: lines averaged, a quarter of which is their scatter
    # judgement: a factor of three between the noise of sensors of one logger
    noise_ratio: float = 9.0

    # ---- tracking
    # Of a peak, to either side of it in its band. What white force leaves out of the slope of the
    # motion's spectrum moves a frequency by 0.6 n z^2 of it, n half widths to a side at a damping
    # z.
    half_widths: float = 10.0
    least_lines: int = 12  # judgement: to either side: a floor is known to a fifth by 24 lines
    # judgement: of the frequency; sensors that are a few degrees off see the other plane, too.
    other_plane: float = 0.08
    # judgement: of log likelihood by which a mode is proven: its five parameters and some two
    # hundred places to look make 10 by chance.
    least_gain: float = 15.0
    # judgement: than the mode as it was known, or than a line: a tone, of trains or machines, near
    # it. Two close modes that were taken for one had up to seven times the damping of each.
    narrower: float = 10.0
    floor: float = 0.2  # quantile of the lines of a band, as shm/identify/quality/of_ambient.py
    # judgement: how often modes are sought that were missed at first, by day and by night; each
    # hour where so few are known, or most are lost. From scratch costs as much as twenty windows
    # that are followed.
    review_s: int = 12 * 3600
    review_few_s: int = 3600
    few: int = 2

    # ---- windows
    # judgement: a fifth of a window of ten minutes, whose frequencies are known 2.2 times worse.
    least_s: float = 120.0
    # technical: 60 periods of 3 Hz; shorter ones hardly resolve a peak
    least_stretch_s: float = 20.0
    block_s: float = 0.25
    stretch_s: float = 5.0  # as `unrest` of an ambient record, shm/identify/quality/of_ambient.py
    before_s: float = 2.0  # judgement: a train comes and goes without a block's edge
    after_s: float = 3.0
    # judgement: an impulse is at its highest in two blocks, a train in seconds
    knock_rise_s: float = 0.5
    knock_s: float = 20.0  # judgement: a knock's ring-down falls by a factor of five in less
    # judgement: five deviations of a mean of twenty spectra.
    quiet_db: float = 5.0
    # judgement: peaks that no known mode explains and that a search from scratch may understand.
    strong_db: float = 10.0
    strong_peaks: int = 3


LIMITS = Limits()
