"""Speed beside other simulators': `python -m benchmarks speed`.

Rows (`rows`) say what is measured. Each row belongs to a worker (`peers`), a process in an
environment of its own whose code is a module of `workers`. All workers stay alive, one works at a
time, and every round measures every row in another order (`measure`), so that what else the machine
does falls on all alike. Ratios (`ratios`) are taken within rounds.

This module, `loops` and `worker` import nothing but the standard library, for they are loaded where
little else is installed.
"""
