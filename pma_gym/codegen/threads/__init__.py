"""Threads: a pool that runs compiled functions, and shares of one piece of work."""
