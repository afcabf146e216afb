"""Learning: the loop, and what it asks of whoever records it."""
