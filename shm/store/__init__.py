"""Keeps every noun of the flow: tables, verbs, the archive of raw files, schema upgrade."""

from shm.store.archive import Archive, Quarantine
from shm.store.export import samples_npz, samples_table
from shm.store.queries import WaitingTest
from shm.store.rows import (
    Acknowledgement,
    Adoption,
    Baseline,
    Delivery,
    DeliveryState,
    Event,
    IdentifiedTest,
    Lineage,
    Outcome,
    Receipt,
    ReceivedFile,
    Stage,
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
from shm.store.workspace import Workspace

__all__ = [
    "Acknowledgement",
    "Adoption",
    "Archive",
    "Baseline",
    "Delivery",
    "DeliveryState",
    "Event",
    "IdentifiedTest",
    "Lineage",
    "Outcome",
    "Quarantine",
    "Receipt",
    "ReceivedFile",
    "Stage",
    "Store",
    "StoredAdoption",
    "StoredAlert",
    "StoredDiagnosis",
    "StoredPosterior",
    "StoredRecording",
    "StoredSelection",
    "StoredTest",
    "StoredWatch",
    "WaitingTest",
    "Workspace",
    "samples_npz",
    "samples_table",
]
