"""Keeps every noun of the flow: tables, verbs, the archive of raw files, schema upgrade."""

from shm.store.active import ActiveLock
from shm.store.archive import Archive, Quarantine
from shm.store.export import samples_npz, samples_table
from shm.store.queries import WaitingTest, WatchedName
from shm.store.rows import (
    Acknowledgement,
    Adoption,
    Baseline,
    Delivery,
    DeliveryState,
    Event,
    FormerPosterior,
    FormerTest,
    IdentifiedTest,
    KeptWatch,
    Lineage,
    Outcome,
    Receipt,
    ReceivedFile,
    Rerun,
    Stage,
    Step,
    StoredAdoption,
    StoredAlert,
    StoredDiagnosis,
    StoredPosterior,
    StoredRecording,
    StoredSelection,
    StoredTest,
    StoredWatch,
)
from shm.store.store import Store
from shm.store.superseding import AGAIN_FROM
from shm.store.tokens import Scope, StoredToken
from shm.store.workspace import Workspace

__all__ = [
    "AGAIN_FROM",
    "Acknowledgement",
    "ActiveLock",
    "Adoption",
    "Archive",
    "Baseline",
    "Delivery",
    "DeliveryState",
    "Event",
    "FormerPosterior",
    "FormerTest",
    "IdentifiedTest",
    "KeptWatch",
    "Lineage",
    "Outcome",
    "Quarantine",
    "Receipt",
    "ReceivedFile",
    "Rerun",
    "Scope",
    "Stage",
    "Step",
    "Store",
    "StoredAdoption",
    "StoredAlert",
    "StoredDiagnosis",
    "StoredPosterior",
    "StoredRecording",
    "StoredSelection",
    "StoredTest",
    "StoredToken",
    "StoredWatch",
    "WaitingTest",
    "WatchedName",
    "Workspace",
    "samples_npz",
    "samples_table",
]
