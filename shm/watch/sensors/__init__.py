"""Watch a hanger by permanent sensors, hour by hour, on the same causes."""
