"""Several set-ups of one test become one: frequencies pooled, shapes over all points."""
