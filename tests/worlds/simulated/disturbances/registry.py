"""What goes wrong in a hammer test, each planted in hits and channels that the truth tells.

A disturbance is one function and one line of `DISTURBANCES`.
"""

from __future__ import annotations

from tests.worlds.simulated.disturbances.base import Channels, Disturbance, Lines, Motion, Planted
from tests.worlds.simulated.disturbances.recording import (
    cable,
    clipping,
    cut_off,
    double_hit,
    drop_out,
    no_pre_trigger,
    noise_only,
    outlier_hit,
    overload,
    soft_hit,
)
from tests.worlds.simulated.disturbances.spurious_vibration import deck, harmonic, machine, mains

__all__ = ["DISTURBANCES", "Channels", "Disturbance", "Lines", "Motion", "Planted"]

_ALL = (
    Disturbance("double_hit", "the hammer bounces once", schedule=double_hit),
    Disturbance("clipping", "an accelerometer saturates", lines=clipping),
    Disturbance("overload", "the force saturates", lines=overload),
    Disturbance("cable", "steps, bursts or loose contact in one channel", lines=cable),
    Disturbance("drop_out", "one channel misses samples or repeats one", channels=drop_out),
    Disturbance("no_pre_trigger", "the record begins within the pulse", schedule=no_pre_trigger),
    Disturbance("cut_off", "one ring-down is cut short", schedule=cut_off),
    Disturbance("soft_hit", "pulses too long for the band", schedule=soft_hit),
    Disturbance("mains", "50 Hz and harmonics in all channels", lines=mains, needs_hits=False),
    Disturbance("machine", "a steady line of a machine", lines=machine, needs_hits=False),
    Disturbance("outlier_hit", "one hit unlike the others", schedule=outlier_hit),
    Disturbance("noise_only", "nobody hit", schedule=noise_only, needs_hits=False),
    Disturbance("harmonic", "a strong mode also rings at twice its frequency", motion=harmonic),
    Disturbance("deck", "a resonance of the deck moves the hanger", motion=deck),
)
DISTURBANCES = {each.name: each for each in _ALL}
