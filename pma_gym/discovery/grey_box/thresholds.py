"""The numbers by which the grey box decides, each with its derivation.

Those that the method for stations has too are in `discovery/thresholds.py`. Numbers of the numerics
stand where they are used.
"""

MATERIAL = 0.02
"""Share of the drive's force (root mean square) above which a latent force matters.

Assumption, what the force constant of a drive is known to. A latent force below it is `agrees` or
`parameters`, however significant. So are trials that differ by less.
"""

LIKE = 3.0
"""Difference of log likelihood, after the price, within which two hypotheses are always rivals.

Odds of 20 to 1. Beyond it they are where the difference is within its own scatter.
"""

TRIED = 5
"""Candidates that are fitted after each screening, the most promising ones."""

HORIZON = 0.25
"""Share of the shortest trial over which a free rig is predicted ahead, at most `HORIZON_S`."""

HORIZON_S = 0.25
"""Longest prediction (s): what a controller of such a rig plans ahead; assumption."""

ODD = 3.0
"""Times the median of all trials' latent forces from which on a trial stands out."""

FAINT = 0.002
"""Share of the drive's force below which only promising candidates are fitted."""

NOISES = 3.0
"""Noises that predictions may miss by where the model is said to be right.

As the campaign on hidden effects counts it.
"""

LOUD = 2.0
"""Times the noise that readings show by their third differences that a fitted noise may have."""

LINE = 0.1
"""Share of their range within which trials' own values lie on a line: then they are a trend."""

FAR = 3.0
"""Factor by which an inertia, or a drive's gain, may differ from the model's.

Assumption: a data sheet or a scale is off by less, so that beyond it the fit bends the value.
"""

SMALL = 0.1
"""Share of the gap (logarithm of the misfit) that an addition closes where much is left."""

LEAST_TRIALS = 3
"""Trials from which on one of them may be the odd one: of two neither is."""

STEP_MISS, STEP_SHARE = 0.1, 0.9
"""Share of a step that a gap between readings may miss a whole one by, and share of gaps that must
not for readings to keep to steps. Assumptions."""
