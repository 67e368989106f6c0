"""Reads `bridge.toml`: the bridge, its hangers, their thresholds, the hooks, the settings."""

from __future__ import annotations

from shm.bridge.description import Bridge, Disturbance, Hook, load_bridge, load_hanger

__all__ = ["Bridge", "Disturbance", "Hook", "load_bridge", "load_hanger"]
