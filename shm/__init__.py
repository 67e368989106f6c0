"""shm: the tension of bridge hangers from hammer tests, with its uncertainty, unattended."""

__version__ = "0.1.0"
