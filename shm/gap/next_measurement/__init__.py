"""Choose the measurement that would tell the leading causes apart best."""
