"""The nouns that flow between the steps: frozen, complete at birth, SI units in their names.

Arrays are numpy arrays whose shapes stand beside them. An unknown number is NaN, an unknown thing
is None; neither is ever 0. Times are timezone-aware UTC. `x_m` runs along the hanger from the deck
end (0) to the arch end (its length).
"""

from __future__ import annotations

from shm.values.diagnosis import (
    Cause,
    Diagnosis,
    EffectEstimate,
    GapPlace,
    NextMeasurement,
    Residual,
    Shrinkage,
    TensionEstimate,
    Trend,
)
from shm.values.hanger import (
    EffectPrior,
    EndPlate,
    Hanger,
    Scatter,
    Thresholds,
    Turnbuckle,
)
from shm.values.kinds import (
    NAN,
    PLANES,
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    Plane,
    Quantity,
    Verdict,
)
from shm.values.modes import (
    ForeignMode,
    ModalTest,
    Mode,
    QualityCheck,
    ShapePoint,
)
from shm.values.posterior import (
    Alert,
    Drift,
    Posterior,
    PredictedFrequency,
    Prior,
    Selection,
)
from shm.values.recording import (
    AddedMass,
    Channel,
    FrequencyResponse,
    Recording,
    ResponsePoint,
)

__all__ = [
    "NAN",
    "PLANES",
    "AddedMass",
    "Alert",
    "BoolArray",
    "Cause",
    "Channel",
    "ComplexArray",
    "Diagnosis",
    "Drift",
    "EffectEstimate",
    "EffectPrior",
    "EndPlate",
    "FloatArray",
    "ForeignMode",
    "FrequencyResponse",
    "GapPlace",
    "Hanger",
    "IntArray",
    "ModalTest",
    "Mode",
    "NextMeasurement",
    "Plane",
    "Posterior",
    "PredictedFrequency",
    "Prior",
    "QualityCheck",
    "Quantity",
    "Recording",
    "Residual",
    "ResponsePoint",
    "Scatter",
    "Selection",
    "ShapePoint",
    "Shrinkage",
    "TensionEstimate",
    "Thresholds",
    "Trend",
    "Turnbuckle",
    "Verdict",
]
