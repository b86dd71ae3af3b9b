"""Experimental: environments on an NVIDIA GPU; not yet run on one, tested on the processor."""
