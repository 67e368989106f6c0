"""Tension of bridge hangers from hammer tests, with its uncertainty, unattended.

In a notebook, from a recording to the tension and what limits it::

    import shm

    hanger = shm.load_hanger("H.toml")
    test = shm.identify(shm.read("hanger3.csv"), hanger=hanger)
    posterior = shm.update(test, hanger, model="beam2", seed=1)
    print(posterior.summary())                                 # the tension, its interval
    choice = shm.select(test, hanger)                          # which model class, how surely
    diagnosis = shm.diagnose(test, hanger)                     # why model and measurement differ
    shm.plot.tension(posterior, hanger)                        # a matplotlib figure
    shm.export.datatree(posterior)                             # what ArviZ reads

- A hanger: `load_hanger` (from TOML), `round_bar` (from its diameter), `Hanger` (from all figures).
- The steps: `read`, `identify`, `update`, `select`, `diagnose`; `simulate` makes a recording whose
  truth is known (a `PlantedEffect` is part of it); `load_modes` takes modal tests that were
  identified before, or elsewhere; `from_sep005` takes channels of other programs of the field.
- `check_gap` says beforehand which effects `diagnose` would find, and from which size on.
- `diagnose_simulator` asks the same of any simulator of your own: a `Simulator` with a `Prior` for
  each parameter, a `SimulatorEffect` for each possible cause, and a `Reading` for each measurement.
- `Store` reads what a workspace keeps of years of tests.
- `plot` draws, `export` hands over to pandas, ArviZ, CSV, netCDF; of a value by itself, its
  `summary()`, `to_dataframe()`, `to_arviz()` do.
- The nouns that flow between the steps are frozen dataclasses: `Recording`, `FrequencyResponse`,
  `Identification`, `ModalTest`, `Mode`, `ShapePoint`, `AddedMass`, `Posterior`, `Selection`,
  `Diagnosis`, `GapCheck`.
- What goes wrong on purpose is a `ShmError`, which says what to do (`shm.errors` has the tree).

SI units throughout (N, m, kg, s, Hz), temperatures in deg C, unknown numbers NaN. The same seed
gives the same result. `read`, `identify` and `simulate` are functions, and packages of the same
name hold what they are made of: `from shm.identify import IdentifyOptions`.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shm import export as export
    from shm import notebook as notebook
    from shm import plot as plot
    from shm.api import Store as Store
    from shm.api import check_gap as check_gap
    from shm.api import diagnose as diagnose
    from shm.api import diagnose_simulator as diagnose_simulator
    from shm.api import from_sep005 as from_sep005
    from shm.api import identify as identify
    from shm.api import load_hanger as load_hanger
    from shm.api import load_modes as load_modes
    from shm.api import read as read
    from shm.api import round_bar as round_bar
    from shm.api import select as select
    from shm.api import simulate as simulate
    from shm.api import update as update
    from shm.errors import ShmError as ShmError
    from shm.gap.simulator.simulator_problem import Prior as Prior
    from shm.gap.simulator.simulator_problem import Reading as Reading
    from shm.gap.simulator.simulator_problem import Simulator as Simulator
    from shm.gap.simulator.simulator_problem import SimulatorEffect as SimulatorEffect
    from shm.identify import Identification as Identification
    from shm.simulate import PlantedEffect as PlantedEffect
    from shm.values import AddedMass as AddedMass
    from shm.values import Diagnosis as Diagnosis
    from shm.values import FrequencyResponse as FrequencyResponse
    from shm.values import GapCheck as GapCheck
    from shm.values import Hanger as Hanger
    from shm.values import ModalTest as ModalTest
    from shm.values import Mode as Mode
    from shm.values import Posterior as Posterior
    from shm.values import Recording as Recording
    from shm.values import Selection as Selection

__version__ = "2.0.0"

_STEPS_AND_PACKAGES = ("identify", "read", "simulate")
_HOMES = {
    "shm.api": (
        "Store", "check_gap", "diagnose", "diagnose_simulator", "from_sep005", "load_hanger",
        "load_modes", "round_bar", "select", "update",
    ),
    "shm.errors": ("ShmError",),
    "shm.gap.simulator.simulator_problem": ("Prior", "Reading", "Simulator", "SimulatorEffect"),
    "shm.identify": ("Identification",),
    "shm.simulate": ("PlantedEffect",),
    "shm.values": (
        "AddedMass", "Diagnosis", "FrequencyResponse", "GapCheck", "Hanger", "ModalTest", "Mode",
        "Posterior", "Recording", "Selection", "ShapePoint",
    ),
}  # fmt: skip
_HOME = {name: home for home, names in _HOMES.items() for name in names}
_MODULES = ("export", "plot")

__all__ = sorted([*_HOME, *_MODULES, *_STEPS_AND_PACKAGES])


class _Package(ModuleType):
    """A package whose name is also that of a step: what it holds is an attribute of the step, too.

    So `import shm.identify.options as options` finds its way through the function.
    """

    def __setattr__(self, name: str, value: object) -> None:
        super().__setattr__(name, value)
        step = vars(sys.modules["shm"]).get(self.__name__.removeprefix("shm."))
        if isinstance(step, FunctionType):
            vars(step)[name] = value


class _Shm(ModuleType):
    """This package; it hears of each sub-package as it is imported, whoever imports it."""

    def __setattr__(self, name: str, value: object) -> None:
        if name == "values":
            import_module("shm.values.showing").set_display_package(self)
        if name in _STEPS_AND_PACKAGES and type(value) is ModuleType:
            value.__class__ = _Package
            return  # the name is the step's, which `__getattr__` loads
        super().__setattr__(name, value)


def _load_step(name: str) -> object:
    """Return the step of a name, with what the package of that name holds as its attributes."""
    package = import_module(f"shm.{name}")
    step = getattr(import_module("shm.api"), name, None)
    if not isinstance(step, FunctionType):
        return package  # asked for while the steps are being loaded
    names = {*vars(package), *getattr(package, "__all__", ())}
    held = {each for each in names if not each.startswith("__")} | {"__file__", "__path__"}
    vars(step).update({each: getattr(package, each) for each in held})
    if hasattr(package, "__all__"):
        vars(step)["__all__"] = package.__all__
    setattr(sys.modules[__name__], name, step)
    return step


sys.modules[__name__].__class__ = _Shm

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """Load a public name at its first use, so that `import shm` stays cheap."""
        if name in _STEPS_AND_PACKAGES:
            return _load_step(name)
        if name in (*_MODULES, "notebook"):
            return import_module(f"shm.{name}")
        if name not in _HOME:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__", "__doc__", "__file__", "__name__", "__path__"]


def _show_in_notebook() -> None:
    """Register how values are shown with the shell of a notebook that imports us."""
    running = getattr(sys.modules.get("IPython"), "get_ipython", None)
    shell = running() if running else None
    if shell is not None:
        from shm.notebook import load_ipython_extension

        load_ipython_extension(shell)


_show_in_notebook()
