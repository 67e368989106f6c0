"""What happens to a hanger in its simulated years."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["nothing", "tension", "one spring", "both planes"]

USUAL_SEASON_K, HARD_SEASON_K = 15.0, 25.0


@dataclass(frozen=True)
class Scenario:
    """A change from its beginning on, or none.

    `step` is a fraction of the tension, `ramp_per_year` a fraction a year; `spring_loss` a fraction
    of the rotational stiffness of one end. The season's swing is plus and minus `season_k`.
    """

    name: str
    title: str
    kind: Kind = "nothing"
    step: float = 0.0
    ramp_per_year: float = 0.0
    spring_loss: float = 0.0
    season_k: float = USUAL_SEASON_K

    @property
    def changes(self) -> bool:
        return self.kind != "nothing"


QUIET = Scenario("quiet", "no change")
HARD_QUIET = Scenario("quiet25", "no change, season of 25 K", season_k=HARD_SEASON_K)
_ALL = (
    QUIET,
    HARD_QUIET,
    Scenario("step2", "tension -2 %", "tension", step=-0.02),
    Scenario("step5", "tension -5 %", "tension", step=-0.05),
    Scenario("step10", "tension -10 %", "tension", step=-0.10),
    Scenario(
        "step3hot", "tension -3 %, season of 25 K", "tension", step=-0.03, season_k=HARD_SEASON_K
    ),
    Scenario("ramp2", "tension -2 % a year", "tension", ramp_per_year=-0.02),
    Scenario("spring", "one end -30 %, one plane", "one spring", spring_loss=0.3),
    Scenario("springs", "one end -30 %, both planes", "both planes", spring_loss=0.3),
)
SCENARIOS = {each.name: each for each in _ALL}
