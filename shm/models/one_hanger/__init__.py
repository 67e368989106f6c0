"""Describe one hanger by its class, its uncertain terms, effects and adopted causes."""
