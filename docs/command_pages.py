"""Write pages of the manual that tables of the product make: effects, settings, licences."""

from __future__ import annotations

import re

from shm.assumptions import DEFAULTS, Assumption, number_text
from shm.models.effects import EFFECTS, Effect
from shm.settings import TABLE
from shm_cli.common import markdown
from shm_cli.effects import (
    OVERVIEW_HEADS,
    PARAMETER_HEADS,
    facts,
    parameter_rows,
    parameters,
    shown_by,
    what,
)
from shm_cli.installation import SETTING_HEADS, notices, setting_cells

_ASSUMPTION_HEADS = ("assumption", "value", "unit", "from", "source", "reason")
_EFFECTS = """# Catalogue of effects

After this page you know the physical effects that `shm gap diagnose` knows: the reasons why a
hanger can differ from its model. Each is a term of the general hanger model that vanishes at one
value of its first parameter, its *size*.

Priors are deliberately wide: most sizes are logarithmic, and *either sign* means that the effect
may raise or lower. Lengths, masses and stiffnesses are scaled by those of the hanger; the numbers
below are for [hanger 3](hangers.md#round-bar-with-end-plates). Narrow any range that you know
better in `bridge.toml`, see [hangers.md](hangers.md#ranges-of-effects).

An effect that your measurements cannot show is not tried, and the diagnosis gives the reason. One
that they show but cannot separate from another is reported as a group with it; *easily taken for*
lists what to think of then. What imitates what:

- More mass along the hanger, less bending stiffness and a clock by which frequencies read too low
  give the same frequencies and shapes once the tension is free. A known mass clamped on for one
  test separates the mass from the other two; no hammer test separates stiffness from clock:
  compare the logger with another clock. Effective length and stiff end zones are similar in
  frequencies; shapes separate them.
- A stiff end spring k and a bar that is longer by EI/k are the same to first order, in frequencies
  and in shapes; so are a short stiff zone and a bar that is shorter by about its length.
- Changes of mass, stiffness or length below 1 to 2 % are within the tolerances of the description
  (`[hanger.scatter]`) and are no gap.
- Rotated sensors show in shapes only. Effects of temperature and level show only in tests that vary
  them, and can be separated only if the warm tests are not the hard ones too.
- Joints that soften or are skewed look like plain end flexibility if the level is not varied, or if
  the sensors see one plane only.
- A small mass close to an end, an end that gives way sideways, and shear with rotary inertia all
  lower the high orders in a similar way.
- Frequencies of a uniform hanger cannot distinguish its two ends: deck end and arch end, or a
  position and its mirror image, need shapes or a known mass.
"""


def effects_page() -> str:
    """Return the page of all effects in Markdown, in the order of the catalogue."""
    rows = [(f"[`{e.name}`](#{e.name})", e.title.lower(), shown_by(e)) for e in EFFECTS.values()]
    parts = [_EFFECTS + "\n" + markdown(OVERVIEW_HEADS, rows)]
    return "\n\n".join(parts + [_section(effect) for effect in EFFECTS.values()]) + "\n"


def _section(effect: Effect) -> str:
    table = markdown(PARAMETER_HEADS, parameter_rows(list(parameters(effect).values())))
    return "\n\n".join([f"## {effect.name}", what(effect), table, facts(effect)])


def settings_page() -> str:
    """Return the manual's page of settings in Markdown, from the one table of settings."""
    head = (
        "# Settings\n\n"
        "A value comes from the flag, else the environment (`workers` from `SHM_WORKERS`), else "
        "`[settings]` of `bridge.toml`, else the default. `shm settings` prints the same.\n\n"
    )
    rows = [(f"`{row.name}`", *setting_cells(row)) for row in TABLE]
    return f"{head}{markdown(SETTING_HEADS, rows)}\n\n{_assumptions_section()}"


def _assumptions_section() -> str:
    """Return the section of the manual that lists the defaults, in Markdown."""
    head = (
        "## Assumptions\n\n"
        "Values and priors of hangers, sensors and tests before any data. `[assumptions]` of "
        "`bridge.toml` replaces rows for the bridge, `[hanger.assumptions]` for one hanger, and "
        "`[hanger.scatter]` overrides both. Every report names what was replaced; `shm settings "
        "--assumptions` lists what is in force ([why one table]"
        "(decisions/0007-one-table-of-assumptions.md)).\n\n"
        "```toml\n"
        "[assumptions]\n"
        "accelerometer_mass_kg = 0.2\n"
        "strand_bending_factor = [0.5, 1]         # compacted strands\n"
        'tension_reading_sd = {value = 0.01, reason = "jack calibrated in 2026"}\n'
        "```\n\n"
    )
    rows = [
        (f"`{row.name}`", *_assumption_cells(row)[1:3], *_assumption_cells(row)[4:])
        for row in DEFAULTS.values()
    ]
    return head + markdown((*_ASSUMPTION_HEADS[:3], *_ASSUMPTION_HEADS[4:]), rows) + "\n"


def _assumption_cells(row: Assumption) -> tuple[str, ...]:
    source = re.sub(r"^docs/", "", row.source)
    return row.name, number_text(row), row.unit, row.origin, source, row.reason


def licences_page() -> str:
    """Return the manual's page of licences in Markdown, of the packages that are installed."""
    head = (
        "# Licences\n\n"
        "`shm` itself is under the MIT licence. These are the packages that it requires, with the "
        "licence that each declares; those of an extra are needed for that extra only. `shm "
        "notices` lists those of your installation, with the files of the licence texts.\n\n"
    )
    rows = [(each.package, each.version, each.licence, each.extra) for each in notices()]
    return head + markdown(("package", "version", "licence", "extra"), rows) + "\n"
