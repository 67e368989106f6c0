"""The shm command line: one module a verb, or of verbs that share."""
