"""From a measurement to its modes: the identifiers, and what proves a pole."""
