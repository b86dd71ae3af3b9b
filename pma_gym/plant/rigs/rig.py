"""The class `Rig`: the ports, parts, balances and equilibrium of a kind of rig."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from pma_gym.data.signals import Signal
from pma_gym.effects.ports import Port
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.equilibrium.problem import EquilibriumProblem

REFUSED_AIR: dict[str, str] = dict.fromkeys(
    ("air_chamber", "regulator_second_order"),
    "its regulator has a lag of first order; take [regulator_lag], or plant = 'muscle_joint'",
)
"""Forms of the air that rigs with a regulator of first order do not have, with the reason."""


class TakenCommand(NamedTuple):
    """A command that a rig takes where its model has an effect.

    Attributes:
        effect: the effect that receives it.
        slot: its place among the commands of the equations: 0 the motor's, 1 the regulator's.
        name: signal that a trial commands it by; what has limits ends there.
        wish: signal that may be commanded instead, by the effect's line of gain and offset.
        is_signed: whether that may be below 0.
    """

    effect: str
    slot: int
    name: str
    wish: str = ""
    is_signed: bool = False


@dataclass(frozen=True)
class Rig:
    """A kind of rig. A new one is one file beside this one, and one line of the registry.

    Attributes:
        name: name of the rig, as in `plant = "..."` of a model file.
        signals: measured signals, in the order of its outputs.
        ports: ports, with the number of effects and the use of their results.
        parts: required effects that the rig reads directly.
        position_tolerances: states with a smaller tolerance than the others, and its ratio to
            theirs.
        write_equations: writes the equations of motion, with the model's effects at the ports.
        solve_equilibrium: sets the states of an `EquilibriumProblem` to equilibrium.
        refused_effects: effects without a meaning at their port on this rig, with the reason.
        absent_signals: reason why the rig lacks other signals, and what to do with a log that has
            them.
        shipped_example: shipped model to copy a missing part from; "" for none.
        balances_loads: whether a muscle balances the drive's load, so that a load has an
            equilibrium and a person or a weight can act.
        is_free: whether the rig has no equilibrium; the [start] table gives the initial state.
        has_muscle: whether it has a muscle, with pressure and limits.
        is_diagnosable: whether it is a balance of forces that effects add to, as a diagnosis needs.
        needed_ports: for a port, the other port at which a model must have an effect before one can
            be missing there: a rig without a regulator cannot lack a regulator's lag.
        modifying_ports: ports whose effects only modify other effects.
        moving_lags: states of sensor lags whose input moves at the start of a trial, with the state
            that is the input's rate.
        start_paths: parameters of a free rig's initial state, keyed by the state: position, then
            speed.
        drive_port: port of the drive whose force moves a free rig.
        inertia: part and field of what the net force accelerates; empty where no one part is that.
        push_port: port at which a force from outside adds to what moves; "" for none.
        imposes_motion: whether the drive follows a record of positions and the force is an output.
        direct_commands: for each drive, the command in SI that it takes without a voltage
            calibration.
        companions: pairs of an effect, and of effects one of which a model with it must have.
        commands: commands by the effects that take them; empty for a motor's and a regulator's.
    """

    name: str
    signals: tuple[Signal, ...]
    ports: Mapping[str, Port]
    parts: tuple[str, ...]
    position_tolerances: Mapping[str, float]
    write_equations: Callable[[PlantEquations], None]
    solve_equilibrium: Callable[[EquilibriumProblem], None]
    refused_effects: Mapping[str, str] = field(default_factory=dict)
    absent_signals: str = ""
    shipped_example: str = ""
    balances_loads: bool = False
    is_free: bool = False
    has_muscle: bool = True
    is_diagnosable: bool = False
    drive_port: str = ""
    inertia: tuple[str, ...] = ()
    push_port: str = ""
    imposes_motion: bool = False
    needed_ports: Mapping[str, str] = field(default_factory=dict)
    modifying_ports: tuple[str, ...] = ()
    moving_lags: Mapping[str, str] = field(default_factory=dict)
    start_paths: Mapping[str, str] = field(default_factory=dict)
    direct_commands: Mapping[str, str] = field(default_factory=dict)
    commands: tuple[TakenCommand, ...] = ()
    companions: tuple[tuple[str, tuple[str, ...]], ...] = ()

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the rig's signals, as in its equations and trials."""
        return tuple(signal.name for signal in self.signals)
