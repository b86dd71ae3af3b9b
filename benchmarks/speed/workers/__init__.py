"""What each peer runs, `serve_PEER`: a table ROWS of functions that prepare a row.

A module is imported in its peer's environment, where little else is installed. See
`benchmarks.speed.worker`.
"""
