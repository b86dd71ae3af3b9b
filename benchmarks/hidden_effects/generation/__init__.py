"""Drawing cases: effects, excitation, rigs, and whether data can tell the truth at all."""
