"""From records to measurements: hits, faults, windows, frequency responses, set-ups."""
