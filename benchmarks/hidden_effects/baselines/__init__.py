"""Baselines: simpler diagnoses, and ours with one part off, on the same cases.

`registry.BASELINES` names them; `python -m benchmarks.hidden_effects.baselines run` runs them and
prints one table. A baseline takes a data set, a seed and a number of threads, and answers with the
keys of `diagnosis.json` that `verdicts.compare` reads.
"""
