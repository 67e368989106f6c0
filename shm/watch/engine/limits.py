"""The judgements and technical limits of the watch, in one table."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Hold each limit with its unit and reason; where no source is named it is a judgement."""

    # ---- agreement
    # Standard deviations from the baseline, temperature and scatter included: one good test in 740
    # lies that far to one side, fewer than are blunders.
    agreement_clear: float = 3.0
    # Standard deviation, in steps, of what a test does not see: far beyond any threshold.
    pull_steps: float = 10.0
    # Of what a test scatters by beyond its errors: the most that is usual over what is assumed.
    most_scatter: float = 2.0

    # ---- alert text
    probable: float = 0.1  # judgement: one in ten is worth a test that tells it from the rest
    sure: float = 0.9  # judgement: below nine in ten a sentence says "most likely"
    either_likely: float = 0.8  # judgement: four to one that it was sudden, or slow
    certain: float = 0.995  # reads 1.00 in two decimals, which nobody may claim
    alert_text_least_share: float = 0.05  # judgement: beyond, an end is as good as free or clamped
    largest_factor: float = 1e3
    longest_test: int = 80  # of a key's 255 characters
    alert_text_digits: int = 12

    # ---- ambient hammer
    # Of ln f, from test to test of a mode: conditions within TOGETHER, and how sensors are mounted.
    test_scatter: float = 5e-4

    # ---- baseline check
    enough: int = 3  # tests from which on the odd mode can be told: of two that differ, neither is
    baseline_check_fewest: int = 5  # modes of a test: fewer leave nothing to tell the odd one by
    # Of a log frequency. Judgement: by which no bar as made is off its class in one mode alone; a
    # class compared with a bar as made.
    baseline_check_off: float = 0.04
    # Judgement, standard deviations of what tests of one baseline differ by: in common, as clocks
    # and sensors do; in tension, as seasons and traffic do; in decades of a spring.
    common_sd: float = 1e-3
    tension_sd: float = 0.1
    decades_sd: float = 0.3
    # Judgement: by what all modes of a wrong clock are off alike; how many tests have one; below
    # which warmth and sensors do as much; and the least that tests differ by in tension and
    # decades.
    clock_sd: float = 0.05
    wrong_clock: float = 0.003
    least_clock: float = 0.007
    least_spread: tuple[float, ...] = (0.01, 0.03)
    enough_for_clocks: int = 4  # of three tests, two alike may be chance

    # ---- causes
    # Places along the hanger, a share of the length: a uniform bar is the same from either end.
    places: tuple[float, ...] = (0.06, 0.13, 0.2, 0.28, 0.36, 0.43, 0.5)
    apart: float = 0.035  # to half way between two places, among which a mass is anywhere
    # judgement: lamps and cables are a few per cent of a hanger, no longer linear
    lamp_units: float = 3.0
    stretches: tuple[tuple[float, ...], ...] = ((0.08, 0.15), (0.25, 0.15), (0.5, 0.15), (0.3, 0.4))
    # One unit of each cause: what there is as a rule; six times as much is looked for, too.
    mass_share: float = 0.01
    loss: float = 0.05
    causes_stiffer: float = 0.03
    clock: float = 1e-3
    unexplained: float = 3e-3
    # technical: of the largest; the rest is within a mode's own scatter
    seen_of_sensors: float = 1e-2
    step_to: float = 0.1  # technical: causes are linear to a tenth of a unit and beyond
    # Shifts of springs that one cause loosens, in steps, before any data (judgement): a pin that
    # wears takes stiffness from its end in both planes about alike.
    correlation: float = 0.8

    # ---- change point
    unmeasured: float = 1e8  # technical: variance of a mode not measured; no log frequency is 1e4
    a_week_years: float = 7 / 365.25
    change_point_leading: int = 24  # technical: changes that draws are of, the most probable

    # ---- frequencies
    # Of a frequency. Half of what stiffens concrete and asphalt by 1e-3 / K is that of the
    # frequency: 2 to 5e-4 / K of many bridges in mild weather (Peeters and De Roeck 2001; Magalhaes
    # et al. 2012).
    per_kelvin_sd: float = 5e-4
    # Below 0 C: bridge Z24 gained 1e-2 / K as its asphalt stiffened (Peeters and De Roeck 2001).
    per_kelvin_of_frost_sd: float = 5e-3
    creep_per_year_sd: float = 1e-3  # judgement: concrete stiffens, settlement goes on
    frequencies_step: float = 0.01  # judgement: of a frequency, what may not be missed
    wander: float = 1e-3  # judgement: moisture; Magalhaes et al. 2012 leave 1e-3
    wander_of_a_mode: float = 5e-4
    wander_days: float = 45.0  # judgement: as long as a deck takes to dry
    frequencies_scatter: float = 5e-4  # before any test: traffic; the identification
    scatter_of_a_mode: float = 5e-4
    # of frost where no thermometer was read: judgement, a mild winter's days
    frost_spread_k: float = 2.0
    # Judgement: of what lasts, loads, stiffness of the whole and clocks are half; a local damage
    # moves several modes, each by its own amount, more often than one alone.
    alike_share: float = 0.5
    alone_share: float = 0.2
    each_share: float = 0.3
    # Of a log frequency: a mode has another name only where that brings all nearer by as much in
    # sum.
    renamed: float = 0.02

    # ---- gap
    # judgement: beyond the scatter of a misfit of a dozen modes from test to test
    grown: float = 3.0
    visible_percent: float = 0.1  # three times the sd of a frequency, 3e-4

    # ---- mistaken modes
    # Of routine modes so many are mistaken: judgement, of hammer tests that were checked by hand.
    mistaken: float = 0.04
    # What a mistaken one may be off by, in log frequency: two neighbouring orders of a low mode.
    mistaken_range: float = 0.7
    small_sets: int = 2
    # Of tests so many are of a bar that its class does not describe, all of whose modes lie off by
    # a little: judgement, a joint or a fitting that is new. By how much, from a percent on:
    # technical.
    misfit: float = 0.001
    misfit_sds: tuple[float, ...] = (0.01, 0.02, 0.04)

    # ---- neighbours
    neighbours_fewest: int = 3  # hangers: of two, either may be the one that moved
    suspects: int = 3  # listed, and tried in pairs

    # ---- neighbours words
    sure_which: float = 0.8  # judgement: four to one

    # ---- notices
    clear_drift: float = 2.0  # judgement: that tests and baseline disagree is known by then
    # Of a log frequency: more than sensors, joints and traffic do to a mode by itself (judgement).
    notices_off: float = 0.01

    # ---- persistence
    near: int = 2  # tests to each side: a blunder may lie between two that agree
    before: int = 5  # counted tests that say where the hanger was
    agreeing: float = 0.4  # judgement: of those before; two of five
    wider: float = 10.0  # judgement: how a blunder lies, ten times as wide and with heavy tails
    persistence_tail: float = 2.0
    shown: float = 0.5  # of a change: half of it or more is nearer to it than to none
    showing: float = 0.9  # judgement: of the tests after a change; one in ten is disturbed itself
    slipped: float = 0.15
    slipped_as_from: float = 20.0
    seem: float = 0.03
    as_from: float = 5.0
    # Of a log frequency (judgement): no load that passes does as much, but a blunder may.
    large: float = 0.04
    large_seem: float = 0.01
    # Of a log frequency: what only another hanger's test does, if it is no change; one in 10,000
    # first tests, since it fitted the description.
    gross: float = 0.08
    gross_before: float = 1e-4
    # Judgement: tests that are odd for other reasons agree with each other by chance.
    odd_alike: float = 0.03
    # Years: vans come with tests, not with time; a long wait before two tests makes them no surer,
    # and visits in haste make a change that stays no less likely.
    least_waited: float = 7 / 365.25
    most_waited: float = 1 / 12
    # Hypotheses that are asked, none that others beat by 20 to 1: technical, of so many at most.
    persistence_leading: int = 12
    telling: float = 0.5  # of a change: a test that is less sure of it by itself says nothing

    # ---- posterior summary
    alike_nats: float = 3.0  # 20 to 1: what is as likely is named beside
    posterior_summary_tail: float = 0.05  # 90 % lie between
    posterior_summary_digits: int = 3  # probabilities that read alike are ordered by tension first
    traded: float = 0.25  # judgement: of what an end does, that looks like another tension
    beyond_doubt: float = 1e4  # judgement: times what a detection takes

    # ---- quantities
    quantities_tension_step: float = 0.05  # the default threshold: what an owner is told of
    stiffness_step_decades: float = 0.3  # a factor of 2
    invisible: float = 1e-5  # of a frequency: a thirtieth of the best identification's sd
    finer: int = 10  # technical: points between two nodes
    # Judgement: bars with forks and turnbuckles go otherwise than their description, and how far
    # their frequencies go with a change is known to a tenth at best.
    quantities_model_off: float = 0.1
    # judgement: of the baseline's tension, below it only its own weight strains it
    slack: float = 0.02
    # Below this a rise is the model's rounding: nodes as near as that are one.
    rounding: float = 1e-10

    # ---- readings
    # Of good tests, by their misfit (judgement): a worse one has larger errors than stated.
    seldom: float = 1e-3
    # Far above the rounding of a log frequency, far below what a test can tell.
    least_slope_step: float = 1e-7
    most_steps: int = 12
    starts: int = 24  # technical: of a tension from a fiftieth to five times the nominal one
    # In units of the reading's variance: a last step of a tenth of its standard deviation is taken
    # along with the reading, which is linear about the place before it.
    settled: float = 1e-2
    # Information, per step_sd, of which 10,000 tests together say as much as the prior of a change.
    unseen: float = 1e-4
    # How far a search leaves the tables, in log frequency: more than noise, less than a blunder.
    beyond: float = 0.05
    readings_stiffer: float = 0.01
    # Judgement: how stiff an end may be that is found to be stiffer, in units of the bending
    # stiffness over its length of decay, sqrt(EI / T): a clamp is infinite, and at 1 an end is half
    # way.
    may_be: tuple[float, ...] = (20.0, 7.0, 2.5, 1.0)
    seen: float = 1e-6  # of a mean log frequency: below it a pattern is rounding
    # Of a frequency: what tests differ by beyond their errors, a logger's clock, a tenth of a
    # kelvin.
    frequency_allowance: float = 1e-4
    # Mode by mode two tests of one state differ by more than is stated: the sensors' mass and
    # place, a joint that gives. Judgement, the better end of what repeated tests of real hangers
    # show.
    mode_scatter: float = 1e-3
    loosened_steps: float = 6.0  # judgement: of the largest change of an end that is looked for
    # of tests with a mode that seems mistaken, judgement: an end has loosened
    loosened: float = 0.5
    # Of a log frequency: a mode that is off by less may be so by its joint or its sensor.
    least_mistake: float = 0.006
    rounds: int = 3  # technical: of "which modes are sound" and "where they lie"
    prior_freedom: float = 4.0  # judgement: stated sds are off by a factor of up to two

    # ---- repair check
    half: float = 0.5  # judgement: of what was told, so much may be left where it is repaired

    # ---- state
    seconds_a_year: float = 365.25 * 86400  # Julian
    few: int = 5  # fewer give an sd no better than to a third
    a_step: float = 0.5  # likelier a step than a ramp; tests: judgement, see `set_free`
    state_clear: int = 3
    widest: float = 4.0  # prior sds: beyond lies 1 in 16,000
    # technical: rounding and curvature then each spoil a slope by some 1e-5
    slope_step: float = 1e-4

    # ---- state sums
    # judgement: of a cause in a call, which later tests may yet speak for
    state_sums_least_share: float = 1e-6
    # judgement: a dozen tests say more than what was assumed of any hanger
    prior_tests: float = 6.0
    # Of a difference, in its own sds: up to the first all counts, from the second on nothing: what
    # lies that far is a change, and no scatter (Hampel 1974). One good one in 370 is beyond the
    # first.
    scatter_up_to: float = 3.0
    change_from: float = 6.0

    # ---- stream causes
    # of ln f: joints that slip by another level, each mode by its own. Judgement
    day_sd: float = 3e-4

    # ---- stream filter
    # By what evidence is too large where nobody records a hanger's warmth: in 52 quiet hanger-years
    # of the living bridge it reached 100 years in 6, 1,000 in 4 and 10,000 in none, where one was
    # to be (`tests/benchmarks/stream_trial.py --seed` 4000, 6000, 6100; 2026-11-25).
    overstated: float = 100.0
    # The tension's wander is a fraction of it. Season: a deck's bearings and joints, relaxation of
    # 0.2 % a year (`WatchOptions.creep_per_year_sd`) and as much again. Days: weather, moisture,
    # loads that stay. Hours: sun on one side, traffic. Judgement, after the worlds of
    # `tests/worlds`.
    season_per_root_year: float = 3e-3
    fast_days: float = 1.3 / 24
    slow_days: float = 1.5
    # judgement: of the hours' wander, by what each reading is off on its own: live load
    unsteady: float = 0.2
    slope_days: float = 60.0  # judgement: how long a loss goes on at one rate
    # judgement: of a coefficient's prior sd, by what it wanders in a year
    within_a_year: float = 0.3
    # of the level at the first reading, against the table made of that very reading
    first_sd: float = 0.01
    memory_days: float = 60.0  # judgement: over which the bank forgets which of its filters held
    # Judgement: a change of 2 % a step, or of 0.15 % a day; ten times more or less costs it log 10.
    step_sd: float = 0.02
    slope_sd: float = 1.5e-3
    # No model of the wander is right at all ages: what the scores of changes that never came have
    # been is learnt beside it. Ages (technical), memory, weight of the model itself, and a bound,
    # that a change may not make itself incredible: judgement.
    ages_days: tuple[float, ...] = (0.25, 1.0, 4.0)
    excess_readings: int = 1440
    model_readings: int = 120
    largest_square: float = 12.0
    most: int = 32  # technical: beginnings kept, the newest all, older ones ever farther apart
    recent: int = 10
    oldest_days: float = 180.0  # judgement: what is slower is the season's

    # ---- stream reading
    # Of an hourly log frequency: 1 Hz is read to 1/30 mHz at best, and clocks wander by as much.
    least_sd: float = 3e-5
    # judgement: five days of what modes differ by, ten times a night's
    memory_readings: float = 120.0
    # judgement: of Student's t, as robust regressions take (Lange et al. 1989)
    degrees: float = 4.0
    clip: float = 4.0  # sds: what a mode may add to its spread at once
    # technical: of the tension, for a slope by central differences
    stream_reading_step: float = 0.01
    n_springs: int = 10
    n_shares: int = 4
    # Of a sum of misfits: modes fit a beam to 0.3 % each, nominal tensions are good to 15 %.
    # Judgement.
    nominal: float = 0.003 * 3 / 0.15

    # ---- stream thermometer
    # Derived: of a rod of 20 mm, the thinnest hanger, that loses nothing of the 900 W/m2 of a high
    # sun which fall on its diameter d: 4 x 900 / (pi rho c d), with 7850 kg/m3 and 460 J/(kg K).
    fastest_k_per_h: float = 57.0
    # Judgement: no thermometer resolves less, and no sun's round leaves the air as it was from hour
    # to hour; two days alike at noon are no wonder.
    still_k: float = 1e-3
    still_s: float = 86400.0
    still_windows: int = 24

    # ---- stream watch
    # judgement: until it is reported, as mistaken modes look like it for an hour
    hours_exchanged: int = 3
    ring: int = 24  # readings: a change is told within a day or is slow
    # judgement: by what the part of bending in a sensitivity is known
    stream_watch_model_off: float = 0.2
    hours_of_a_fault: int = 8  # judgement: of which a mistaken mode spoils one or two

    # ---- watcher
    # To be raised whenever the same readings give other results than before: kept states are void
    # then.
    version: int = 17
    # Technical: what a test says goes nearly in proportion to its weight.
    most_repeats: int = 6
    nearly: float = 0.5

    # ---- watching
    odd: float = 0.9  # nine to one: a notice that is wrong costs a test
    odd_in_a_row: int = 3  # tests that fit nothing: no longer bad luck


LIMITS = Limits()
