"""Put a hanger and its tests into a prior and a likelihood."""
