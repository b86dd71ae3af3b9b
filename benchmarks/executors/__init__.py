"""Executors of independent pieces of work: this process, processes here, a Ray cluster."""
