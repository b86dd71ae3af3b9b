"""Simpler ways to diagnose, and ours with one part off, asked about the same cases.

`registry.WAYS` names them; `python -m benchmarks.hidden_effects.baselines run` asks them and prints
one table. A way is asked with a data set, a seed and a number of threads, and answers with the keys
of `diagnosis.json` that `verdicts.compare` reads.
"""
