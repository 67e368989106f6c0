"""Diagnose the gap of any simulator on the same engine."""
