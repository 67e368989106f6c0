"""Define a model class, and the beams of the thesis on the exact solution."""
