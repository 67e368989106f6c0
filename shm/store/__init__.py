"""Keep every value of the flow: tables, transactions, the archive of raw files, schema upgrade."""

from shm.store.archive import Archive, Quarantine
from shm.store.disposition import RERUN_STAGES, Exclusion, Judgement
from shm.store.rows import (
    ENDED,
    Adoption,
    AlertNote,
    Baseline,
    BaselineGlance,
    Deaths,
    Decision,
    Delivery,
    DeliveryState,
    EventKind,
    FormerPosterior,
    FormerTest,
    HangerEvent,
    HeldTest,
    Hold,
    IdentifiedTest,
    Lineage,
    News,
    Numbers,
    Outcome,
    Receipt,
    ReceivedFile,
    Reconciled,
    Rerun,
    Scope,
    Silence,
    Stage,
    StoredAdoption,
    StoredAlert,
    StoredDiagnosis,
    StoredRecording,
    StoredSelection,
    StoredTest,
    StoredToken,
    StoredWatch,
    TestRow,
    TrendPoint,
    WatchCheckpoint,
)
from shm.store.store import Store
from shm.store.workspace import Workspace

__all__ = [
    "ENDED", "RERUN_STAGES", "Adoption", "AlertNote", "Archive", "Baseline",
    "BaselineGlance", "Deaths", "Decision", "Delivery", "DeliveryState", "EventKind", "Exclusion",
    "FormerPosterior", "FormerTest", "HangerEvent", "HeldTest", "Hold", "IdentifiedTest",
    "Judgement", "Lineage", "News", "Numbers", "Outcome", "Quarantine", "Receipt", "ReceivedFile",
    "Reconciled", "Rerun", "Scope", "Silence", "Stage", "Store",
    "StoredAdoption", "StoredAlert", "StoredDiagnosis", "StoredRecording", "StoredSelection",
    "StoredTest", "StoredToken", "StoredWatch", "TestRow", "TrendPoint", "WatchCheckpoint",
    "Workspace",
]  # fmt: skip
