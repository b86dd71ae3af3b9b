"""First-order lag of the drive's load, from the bandwidth of its current loop."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class DriveLag(NamedTuple):
    """Parameters of `late_load`."""

    share: Annotated[
        float, Quantity("1", 0, 1, "1 for a first-order lag, the usual current loop", 0.0, usual=1)
    ]
    time_constant: Annotated[
        float,
        Quantity("ms", 0.001, 200, "assumption: 1-5 for a current loop, 20 if filtered", usual=10),
    ]


def late_load(load_command, memory, p):
    """Load that has arrived at the pulley.

        L_out = (1 - share) L + m

    Args:
        load_command: load L that the drive commands (N).
        memory: lagging part m (N); share L at rest.
        p: DriveLag: share, time_constant (s).
    Returns:
        Load (N).
    Source:
        First-order lag; the part 1 - share of the load has no lag.
    """
    return (load_command - p.share * load_command) + memory


def late_rate(load_command, p):
    """Rate of the lagging part: m' = (share L - m) / time_constant.

    Args:
        load_command: load L that the drive commands (N).
        p: DriveLag.
    Returns:
        (source, decay) with m' = source - decay * m (N/s).
    """
    decay = 1.0 / p.time_constant
    return decay * (p.share * load_command), decay


DRIVE_LAG = Effect(
    name="drive_lag",
    port="drive_lag",
    parameters=DriveLag,
    held=("share",),
    law=late_load,
    rate=late_rate,
    signature=(
        "load cell late against the voltage: it answers at once and approaches exponentially, its "
        "phase proportional to frequency at low ones; statically absent"
    ),
    memory_scale=50.0,
)
