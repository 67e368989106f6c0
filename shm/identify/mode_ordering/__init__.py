"""Plane and order of each mode, and what is not one of the hanger."""
