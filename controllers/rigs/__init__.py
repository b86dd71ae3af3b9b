"""Controllers of any rig, by its model; `RIG_CONTROLLERS` lists them."""

from controllers.rigs.feedforward import Feedforward
from controllers.rigs.lqg import RigLQG
from controllers.rigs.mpc import RigMPC
from controllers.rigs.pid import FeedforwardPID, RigPID
from controllers.rigs.rig_controller import RigController, RigMeasurement

RIG_CONTROLLERS: dict[str, type[RigController]] = {
    each.name: each for each in (Feedforward, RigPID, FeedforwardPID, RigLQG, RigMPC)
}
"""Controllers by name: what makes a new one."""

__all__ = [
    "RIG_CONTROLLERS",
    "Feedforward",
    "FeedforwardPID",
    "RigMeasurement",
    "RigController",
    "RigLQG",
    "RigMPC",
    "RigPID",
]
