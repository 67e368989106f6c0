"""The shm command line: one module a verb."""
