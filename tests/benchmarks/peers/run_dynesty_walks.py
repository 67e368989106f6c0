"""dynesty's static nested sampler with random walks (500 live points, dlogz 0.509).

By default it draws evenly from ellipsoids below ten dimensions; here these hold so little of what
is likelier that a run had not ended after 570 s.
"""

from __future__ import annotations

from functools import partial

from problem import report
from run_dynesty import run

if __name__ == "__main__":
    report("dynesty", partial(run, sample="rwalk"))
