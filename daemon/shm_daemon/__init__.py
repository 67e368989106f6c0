"""The shm daemon: spool, loop, hooks."""
