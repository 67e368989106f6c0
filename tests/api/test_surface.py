"""What `import shm` gives: names and signatures are pinned, importing is cheap."""

from __future__ import annotations

import inspect
import pickle
import pydoc
import subprocess
import sys
import types
from pathlib import Path

import pytest

import shm

ROOT = Path(__file__).resolve().parents[2]

SIGNATURES = {
    "from_sep005": "(channels, *, hanger=None)",
    "read": "(path, *, planes=None, places_m=None, units=None)",
    "load_modes": "(path)",
    "load_hanger": "(path, hanger_id=None)",
    "round_bar": "(id, *, diameter_m, length_m, elastic_modulus_pa, density_kg_m3, "
    "nominal_tension_n, name='')",
    "identify": "(records, *, hanger=None, test_id=None, band_hz=(2.0, 100.0), identifier='ssi', "
    "cross_check='auto', estimator='h1', reference_force_n=1000.0, frequency_allowance=0.0001, "
    "mains_hz=50.0, window_time_constant_s=inf)",
    "update": "(tests, hanger, model='beam2', *, seed=1, samples=1000, "
    "priors='description', progress, sampler='importance', calibrated_by=())",
    "select": "(tests, hanger, models=None, *, seed=1, samples=1000, "
    "priors='description', progress, sampler='importance', calibrated_by=(), class_priors=None)",
    "diagnose": "(tests, hanger, baseline='', *, without=(), hold_out=(), draws=1000, seed=1, "
    "progress)",
    "check_gap": "(tests, hanger, baseline='', *, effects=(), seeds=1, sound=5, seed=1, progress)",
    "diagnose_simulator": "(simulator, readings, *, candidates=(), seed=1)",
    "simulate": "(hanger, *, tension_n=None, k1_n_m_rad=inf, k2_n_m_rad=inf, k3_n_m_rad=inf, "
    "k4_n_m_rad=inf, damping_ratio=0.001, hits=5, seconds_per_hit=20.0, sampling_rate_hz=512.0, "
    "sensors=2, hammer_x_m=nan, acceleration_noise_m_s2=0.02, effects=(), "
    "amplitude=1.0, temperature_c=nan, reference_c=10.0, added_mass=None, time=None, seed=1)",
    "Store": "(workspace)",
    "plot.tension": "(posterior, hanger, baseline=None, *, ax=None)",
    "plot.trend": "(posteriors, tests, hanger, baseline=None, *, ax=None)",
    "plot.stiffness": "(posteriors, tests, hanger, baseline=None, *, ax=None)",
    "plot.frequencies": "(posterior, test, hanger, *, ax=None)",
    "plot.frequency_response": "(test, hanger=None, *, ax=None)",
    "plot.stabilisation": "(test, hanger=None, *, ax=None)",
    "plot.shapes": "(test, hanger, *, ax=None)",
    "plot.gap": "(diagnosis, hanger, *, ax=None)",
    "plot.causes": "(diagnosis, hanger, *, ax=None)",
    "plot.recording": "(recording, *, ax=None)",
    "plot.gap_check": "(check, *, ax=None)",
    "export.causes": "(diagnosis)",
    "export.inference_data": "(posterior, tests=(), hanger=None)",
    "export.samples": "(posterior)",
    "export.modes": "(tests)",
    "export.datatree": "(posterior, tests=(), hanger=None)",
    "export.write": "(posterior, path, format=None, *, tests=(), hanger=None)",
    "export.check_format": "(path, format=None)",
}
NOUNS = {
    "AddedMass", "Diagnosis", "FrequencyResponse", "GapCheck", "Hanger", "Identification",
    "ModalTest", "Mode", "PlantedEffect", "Posterior", "Prior", "Reading", "Recording", "Selection",
    "ShapePoint", "ShmError", "Simulator", "SimulatorEffect",
}  # fmt: skip


def named(path: str) -> object:
    found: object = shm
    for part in path.split("."):
        found = getattr(found, part)
    return found


def bare(signature: inspect.Signature) -> str:
    """Return the signature without types; a default that is a function is left out."""
    parameters = [
        each.replace(
            annotation=inspect.Parameter.empty,
            default=inspect.Parameter.empty if callable(each.default) else each.default,
        )
        for each in signature.parameters.values()
    ]
    return str(signature.replace(parameters=parameters, return_annotation=inspect.Signature.empty))


def run_python(code: str) -> str:
    """Return what a new interpreter prints that runs some code without a complaint."""
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (ran.returncode, ran.stderr) == (0, "")
    return ran.stdout


def test_names_are_pinned_and_told_by_help_and_dir() -> None:
    top = {name for name in SIGNATURES if "." not in name}
    assert set(shm.__all__) == top | NOUNS | {"plot", "export"}
    assert {f"plot.{name}" for name in shm.plot.__all__} == {
        name for name in SIGNATURES if name.startswith("plot.")
    }
    assert {f"export.{name}" for name in shm.export.__all__} == {
        name for name in SIGNATURES if name.startswith("export.")
    } | {"export.FORMATS"}
    text = shm.__doc__ or ""
    assert set(shm.__all__) <= set(dir(shm))
    assert [name for name in shm.__all__ if f"`{name}`" not in text] == []
    with pytest.raises(AttributeError, match="no attribute 'indentify'"):
        shm.indentify  # noqa: B018


@pytest.mark.parametrize("name", SIGNATURES)
def test_a_signature_is_pinned_and_its_docstring_shows_an_example(name: str) -> None:
    assert bare(inspect.signature(named(name))) == SIGNATURES[name]  # type: ignore[arg-type]
    assert ">>> " in (inspect.getdoc(named(name)) or "") or name == "export.check_format"


STEPS = ("read", "identify", "simulate")


@pytest.mark.parametrize("name", STEPS)
def test_help_shows_function(name: str) -> None:
    """As `help(shm.identify)` and IPython's `shm.identify?` do."""
    step = getattr(shm, name)
    assert isinstance(step, types.FunctionType)
    heading, _, signature, *text = pydoc.render_doc(step, renderer=pydoc.plaintext).split("\n")
    assert heading == f"Python Library Documentation: function {name} in module shm.api"
    assert signature.startswith(f"{name}({next(iter(inspect.signature(step).parameters))}: ")
    assert text[0].strip() == (inspect.getdoc(step) or "").partition("\n")[0]
    assert pydoc.locate(f"shm.{name}") is step
    assert pickle.loads(pickle.dumps(step)) is step


IMPORTS = (
    "import shm.identify.options",
    "import shm.identify.options as options",
    "from shm.identify.options import IdentifyOptions",
    "from shm.identify import options",
    "from shm import identify",
    "import shm",
    "import shm.api",
    "import shm; shm.identify; import shm.identify.estimation.courses as courses; courses.np",
)
# A process of its own for each, forked off one that has the libraries.
AFTER_EACH = """
import os, numpy, scipy.signal
for number, code in enumerate(sys.argv[1:]):
    if os.fork() == 0:
        assert "shm" not in sys.modules
        exec(code)
        print(number, flush=True)
        os._exit(0)
    os.wait()
"""


def test_step_after_any_import() -> None:
    checked = (
        "import shm, sys, types\n"
        "assert isinstance(shm.identify, types.FunctionType)\n"
        "import shm.identify.options as again\n"
        "assert again is sys.modules['shm.identify.options'] is shm.identify.options\n"
        "assert shm.identify.IdentifyOptions is again.IdentifyOptions\n"
        "assert isinstance(sys.modules['shm.identify'], types.ModuleType)\n"
        "try: shm.identify.nothing\nexcept AttributeError as e: print(e, end=' ')"
    )
    codes = [f"{imported}\n{checked}" for imported in IMPORTS]
    said = "'function' object has no attribute 'nothing'"
    printed = run_python(f"import sys\nsys.argv = {['', *codes]!r}\n{AFTER_EACH}")
    assert printed.splitlines() == [f"{said} {number}" for number in range(len(IMPORTS))]


def test_import_is_cheap_and_steps_need_no_slow_library() -> None:
    code = (
        "import sys; before = set(sys.modules); import shm\n"
        "new = set(sys.modules) - before\n"
        "print(*(name for name in new if name.startswith('shm') or 'numpy' in name))"
    )
    printed = run_python(code)
    assert printed.split() == ["shm"]
    code = (
        "import sys, shm\n"
        "for home in (shm, shm.plot, shm.export):\n"
        "    for name in home.__all__: getattr(home, name)\n"
        "print(*sys.modules)"
    )
    printed = run_python(code)
    slow = {"scipy.special", "scipy.linalg", "scipy.sparse", "sqlalchemy", "matplotlib", "pandas"}
    assert not slow & set(printed.split())


def test_a_step_can_be_called_after_its_package_was_imported() -> None:
    code = "import shm.read, shm\ntry: shm.read('none.csv')\nexcept shm.ShmError as e: print(e)"
    printed = run_python(code)
    assert printed.startswith("none.csv: ")
