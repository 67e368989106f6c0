"""Run the command `shm`: one module for each verb, or for verbs that share code."""
