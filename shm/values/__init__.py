"""Define the values that pass between the steps: frozen, complete, SI units in their names.

Arrays are numpy arrays whose shapes stand beside them. An unknown number is NaN, an unknown thing
is None; neither is ever 0. Times are timezone-aware UTC. `x_m` runs along the hanger from the deck
end (0) to the arch end (its length).
"""

from __future__ import annotations

from shm.values.bridge_diagnosis import (
    BridgeDiagnosis,
    HangerTensions,
    SharedCause,
    SharedMember,
)
from shm.values.diagnosis import (
    MEASUREMENT_HOURS,
    NO_GAP,
    Cause,
    Diagnosis,
    EffectEstimate,
    GapPlace,
    Leads,
    NextMeasurement,
    Outlier,
    Residual,
    Shrinkage,
    TensionEstimate,
    Trend,
    effect_label,
)
from shm.values.drift import (
    FREQUENCY,
    TENSION,
    Alert,
    AlertKind,
    Beside,
    Change,
    CreepRate,
    CrossedLimit,
    Drift,
    End,
    ModeReading,
    Moved,
    Reading,
    RepeatedMistake,
    TemperatureCoefficient,
    WatchedQuantity,
    WatchedTest,
    is_frequency,
    is_ratio,
    kind_of,
)
from shm.values.gap_check import (
    EffectCheck,
    GapCheck,
    GapTrial,
    PlantedParameter,
)
from shm.values.hanger import (
    ControlHanger,
    EffectPrior,
    EndKind,
    EndPlate,
    Hanger,
    Kind,
    LengthBy,
    Limits,
    MonitoredHanger,
    Scatter,
    Support,
    Supports,
    Survey,
    Thresholds,
    Turnbuckle,
)
from shm.values.kinds import (
    COLDEST_C,
    NAN,
    PLANES,
    WARMEST_C,
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    Plane,
    Quantity,
    Verdict,
    outdoor_c,
)
from shm.values.modes import (
    LONGEST_TEST_ID,
    ForeignMode,
    ModalTest,
    Mode,
    QualityCheck,
    ShapePoint,
    as_test_id,
    is_test_id,
    printable,
)
from shm.values.posterior import (
    COUNTED_ONCE,
    ENOUGH_EFFECTIVE,
    LEFT_OUT,
    MOST_MISFIT_PERCENT,
    OTHER_UNIT,
    WITHOUT_MODEL,
    Averaged,
    BaselineCheck,
    MistakenMode,
    MistakenTest,
    Posterior,
    PredictedFrequency,
    Prior,
    Selection,
    Summary,
)
from shm.values.recording import (
    TEST_CONDITIONS,
    AddedMass,
    Channel,
    Doubt,
    Fingerprint,
    FrequencyResponse,
    KnownSamples,
    Recording,
    ResponsePoint,
    collect_conditions,
    collect_known_conditions,
)
from shm.values.verdict import (
    FEW_MODES,
    Claim,
    GapVerdict,
    Outcome,
    group_causes,
    is_excluded,
    judge,
)
