"""Effects whose law is approximate in sentences: what they close, what they leave, and why."""

from pma_gym.discovery.report.effect_text import effect_name, effect_names
from pma_gym.discovery.report.figure_text import figure, percent, signal_name
from pma_gym.discovery.result.estimates import Approximate
from pma_gym.discovery.verdict.residual_laws import LAWS
from pma_gym.discovery.verdict.unknown import Reason

MANY = 10.0
"""Times itself from which on the scatter of a size is no longer given in numbers."""


def left_text(known: Approximate) -> str:
    """How much of the misfit is left: `law approximate, 11 % of the misfit ... is left`."""
    laws = "law" if len(known.effects) == 1 else "laws"
    unseen = " in readings left out" if known.held_out else ""
    share = percent(max(known.left, 0.0))
    return f"{laws} approximate, {share} of the misfit beyond noise (mean square) is left{unseen}"


def why_approximate(reason: Reason) -> str:
    """The figure that says that the law of effects which are named is only approximate."""
    limit, share = percent(reason.limit), percent(min(reason.figure, 1.0))
    names = effect_names(reason.effects)
    if reason.why == "slow":
        said = f"{share} of what is slow in the residual is left, of a right law {limit} at most"
    elif reason.why == "autocorrelated":
        said = f"{share} of the residual's autocorrelation is left, of a right law {limit} at most"
    elif reason.why == "scatters":
        said = (
            f"the size of {effect_name(reason.of)} scatters {scatter(reason)}, "
            f"that of a right law by {limit} at most"
        )
    elif reason.why in ("misfit", "explained"):
        floors, name = f"{figure(reason.figure, 2)} noise floors", signal_name(reason.of)
        figures = (
            f"the misfit of {name} is {floors}"
            if reason.why == "misfit"
            else f"a flexible regression explains {floors} of what is left of {name}"
        )
        said = f"{figures}, of a right law {figure(reason.limit)} at most"
    else:
        quantity, variable, _ = (words.partition(" (")[0] for words in LAWS[reason.of])
        said = (
            f"a {quantity} drawn freely over {variable} lowers chi-square by "
            f"{figure(reason.figure)}, {names} by {figure(reason.gain)}"
        )
    return f"the law of {names} is approximate: {said}"


def scatter(reason: Reason) -> str:
    """How a size scatters: `from trial to trial by 20 %`."""
    by = "from trial to trial" if reason.by == "trial" else f"with the {reason.by}"
    many = reason.figure > MANY
    return f"{by} by " + (f"more than {MANY:g} times itself" if many else percent(reason.figure))
