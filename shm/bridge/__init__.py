"""Read `bridge.toml`: the bridge, its hangers, their thresholds, the hooks, the settings."""

from __future__ import annotations

from shm.bridge.description import (
    Bridge,
    Disturbance,
    OtherBridge,
    example_words,
    load_bridge,
    load_hanger,
)
from shm.bridge.hooks import AppriseHook, CommandHook, Hook, WebhookHook
