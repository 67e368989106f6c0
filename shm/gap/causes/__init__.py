"""Find the cause of a gap: the probability of every hypothesis, and what it leaves over."""
