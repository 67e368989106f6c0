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
    Outlier,
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
from shm.values.trial import (
    Answer,
    CaseScore,
    Mark,
    PlantedKind,
    Richness,
    Score,
    TrialScore,
    TrueCase,
    TrueEffect,
    TrueFrequency,
    Way,
)

__all__ = [
    "NAN",
    "PLANES",
    "AddedMass",
    "Alert",
    "Answer",
    "BoolArray",
    "CaseScore",
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
    "Mark",
    "ModalTest",
    "Mode",
    "NextMeasurement",
    "Outlier",
    "Plane",
    "PlantedKind",
    "Posterior",
    "PredictedFrequency",
    "Prior",
    "QualityCheck",
    "Quantity",
    "Recording",
    "Residual",
    "ResponsePoint",
    "Richness",
    "Scatter",
    "Score",
    "Selection",
    "ShapePoint",
    "Shrinkage",
    "TensionEstimate",
    "Thresholds",
    "Trend",
    "TrialScore",
    "TrueCase",
    "TrueEffect",
    "TrueFrequency",
    "Turnbuckle",
    "Verdict",
    "Way",
]
