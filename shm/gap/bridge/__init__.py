"""Diagnose a bridge as one patient: causes that its hangers share."""
