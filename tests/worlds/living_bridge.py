"""A living bridge: an arch bridge whose hangers carry accelerometers that stay, with its truth.

`raw` is what the loggers send, chunk by chunk in order of arrival; `describe` what the owner would
write; `truth` what nobody knows.  `hourly` is the same bridge read once an hour for years, as an
honest identifier would have read it, with `true_tension`.  `Change` is what is done to the plant.
All is a function of the seed; it shares nothing with the program under trial.

Physics
-------
Hanger.  Bar of `bars.py`, growing taut upwards by own weight; rotational springs at both ends,
others in either plane; the boxes of the sensors are point masses.  Rods 60 to
130 mm; strands E 160 GPa, fill 0.86, 83 kN/m3 (EN 1993-1-11, tables 2.2 and 3.1), with 0.35 to
0.85 of the bending stiffness of the full section (Papailiou 1997: between slipping and sticking).
Steel E falls by 3e-4 per K, springs with it.  ln f is a polynomial of ln T, so T may move.

Wind.  Quasi-static drag, spectrum and turbulence of EN 1991-1-4 annex B (length 60 m, intensity
17 %), correlated over U/(10 f) (decay 10, as there), admittance as for a flat side; across the wind
0.4 of it.  Aerodynamic damping rho c D U/(2 m w) along and half of it across.  Lock-in: Strouhal
number 0.2, amplitude by EN 1991-1-4, E.7 (Scruton number), in smooth flow only, as negative damping
that falls with the amplitude.  Level: a year, a day, weather of days, breezes of hours.

Traffic.  Cars and lorries as Poisson arrivals by hour and weekday; trains by a timetable with
delays, goods at night.  The deck moves the lower end: broad band falling above 12 Hz, five modes of
its own, sines at multiples of speed over car length, 2.5 m axles.  Loads pull the hanger.

Joints.  Frequency lower by s a/(a + a_half), damping higher likewise; a is the amplitude.

Temperature.  Arch of each side (2 h, sun), deck (14 h), hanger (40 min), as first-order lags of air
and sun; EN 1991-1-5 has differences of 10 to 15 K.  dT/T per K of deck - 10, arch - deck, row - row
and hanger - arch: of E alpha/stress (a bar held fast) 1, 5, 2 and -2 to -8 %; the first three of
either sign and in equilibrium along a row.  1 to 2 K (sd) are local and unrecorded.

Records.  Mode by mode an exact first-order recursion, with frequency and damping of each second.

Readings.  Random sd by the Cramer-Rao bound of a mode in white noise: sqrt(zeta/(2 pi n)) (Au,
Mech. Syst. Signal Process. 48, 2014) over the Fisher information left by the noise (Whittle).

Levels, probabilities and rates without a source are engineering judgement.

Not in it: the bridge's frame (redistribution is a rule: half of a loss to the two next), inclined
or crossing hangers, sag, rain-wind vibration, galloping, creep, fatigue, Duffing terms, the phase
of neighbours' motion (their modes are in a record as narrow bands of their own), anti-alias
filters, spikes, the true time of a chunk to the second (weather and trains follow the nominal
one), mode shapes that change while T moves.
"""

from tests.worlds.living_hourly import (
    Hourly,
    HourlyFlags,
    bound,
    hourly,
    hourly_arrays,
    true_tension,
)
from tests.worlds.living_physics import PLANES, Change
from tests.worlds.living_raw import CHANNELS, RATE_HZ, Flags, describe, raw, truth

__all__ = [
    "CHANNELS",
    "PLANES",
    "RATE_HZ",
    "Change",
    "Flags",
    "Hourly",
    "HourlyFlags",
    "bound",
    "describe",
    "hourly",
    "hourly_arrays",
    "raw",
    "true_tension",
    "truth",
]
