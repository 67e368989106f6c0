"""Keeps every noun of the flow: tables, verbs, the archive of raw files, schema upgrade."""

from shm.store.archive import Archive, Quarantine
from shm.store.disposition import Exclusion
from shm.store.holding import Judged
from shm.store.rerun import AGAIN_FROM
from shm.store.rows import (
    ENDED,
    Acknowledgement,
    Adoption,
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
    KeptWatch,
    Lineage,
    News,
    Numbers,
    Outcome,
    Receipt,
    ReceivedFile,
    Reconciled,
    Rerun,
    Resolution,
    Scope,
    Silence,
    Stage,
    Step,
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
)
from shm.store.store import Store
from shm.store.workspace import Workspace

__all__ = [
    "AGAIN_FROM", "ENDED", "Acknowledgement", "Adoption", "Archive", "Baseline",
    "BaselineGlance", "Deaths", "Decision", "Delivery", "DeliveryState",
    "EventKind", "Exclusion", "FormerPosterior", "FormerTest", "HangerEvent", "HeldTest", "Hold",
    "IdentifiedTest", "Judged", "KeptWatch", "Lineage", "News", "Numbers", "Outcome", "Quarantine",
    "Receipt", "ReceivedFile", "Reconciled", "Rerun", "Resolution", "Scope", "Silence", "Stage",
    "Step", "Store", "StoredAdoption", "StoredAlert", "StoredDiagnosis", "StoredRecording",
    "StoredSelection", "StoredTest", "StoredToken", "StoredWatch", "TestRow", "TrendPoint",
    "Workspace",
]  # fmt: skip
