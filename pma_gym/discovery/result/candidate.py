"""How each effect of the catalogue fared."""

from dataclasses import dataclass

ADDED = "added to the model"
"""Why a candidate is where it is, if it is in the proposed model."""

UNFITTED = "could not be fitted: its score promises more than any fit of it brings"
"""The same of a candidate that may carry the residual although its fits do not."""


@dataclass(frozen=True)
class Candidate:
    """How one effect of the catalogue fared.

    Attributes:
        name: its name.
        delta_log_likelihood: gain in whitened log-likelihood over the refitted model.
        held_out_gain: the same on trials that it was not fitted to, per reading of theirs, from
            chi-square alone (the verdict also counts what the other trials leave open); None where
            it was not tried.
        p_value: family-wise, of so large a gain by chance.
        change: rms of what it changes in the signals beyond what parameters could, over noise.
        resolvable: smallest size that these data would have shown, as a share of its usual one;
            None where no size would show.
        fitted: whether it was fitted, or only screened.
        why: in words, why it was kept or dropped.
    """

    name: str
    delta_log_likelihood: float
    held_out_gain: float | None
    p_value: float
    change: float
    resolvable: float | None
    fitted: bool
    why: str
