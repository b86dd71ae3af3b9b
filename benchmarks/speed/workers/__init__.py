"""Modules that each peer runs, `serve_PEER`: tables ROWS of functions that prepare rows.

A module is imported in its peer's environment, where little else is installed. See
`benchmarks.speed.worker`.
"""
