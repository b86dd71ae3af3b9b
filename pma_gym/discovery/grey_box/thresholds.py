"""The numbers by which the grey box decides, each with its derivation.

Numbers of the numerics stand beside them.
"""

MATERIAL = 0.02
"""Share of the drive's force (root mean square) above which a latent force matters.

Assumption, what the force constant of a drive is known to. A latent force below it is `agrees` or
`parameters`, however significant.
"""

LIKE = 3.0
"""Difference of log likelihood, after the price, within which two hypotheses are always rivals.

Odds of 20 to 1. Beyond it they are where the difference is within its own scatter.
"""

LEFT = 0.5
"""Share of the predictions' misfit beyond noise (mean square) that named effects may leave.

And of the latent force that a difference by trial may leave: they carry at least half.
"""

MOST_EFFECTS = 3
"""Effects at most: a beam of more was never right on data whose effects are known (design)."""

TRIED = 5
"""Candidates that are fitted after each screening, the most promising ones."""

HORIZON = 0.25
"""Share of the shortest trial over which a free rig is predicted ahead, at most `HORIZON_S`."""

HORIZON_S = 0.25
"""Longest prediction (s): what a controller of such a rig plans ahead; assumption."""

CONFIDENCE = 1.96
"""Standard deviations of a 95 % interval."""

ODD = 3.0
"""Times the median of all trials' latent forces from which on a trial stands out."""

FAINT = 0.002
"""Share of the drive's force below which only promising candidates are fitted."""

NOISES = 3.0
"""Noises that predictions may miss by where the model is said to be right.

As the campaign on hidden effects counts it.
"""

SURE = 3.0
"""Standard errors from none that a size must be for its effect to be named: 1 in 400."""

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

COMPLETE = 1.5
"""Noises that predictions of a complete model miss by at most, as for stations."""
