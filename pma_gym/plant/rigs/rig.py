"""What a rig is: its ports, parts, balances and equilibrium, and what can be asked of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from pma_gym.data.signals import Signal
from pma_gym.effects.effect import Parameters
from pma_gym.effects.ports import Port
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.equilibrium.problem import EquilibriumProblem


@dataclass(frozen=True)
class Rig:
    """A kind of rig. A new one is one file beside this one, and one line of the registry.

    Attributes:
        name: its name, as `plant = "..."` of a model file says it.
        signals: what its sensors measure, in the order of its outputs.
        ports: its ports: how many effects each takes, and what becomes of their results.
        parts: effects that it reads itself and cannot do without.
        position_tolerances: states that are held to a smaller error than the others, and their
            tolerance as a share of the others'.
        write_equations: writes its balances, with the model's effects at its ports.
        solve_equilibrium: puts the states of an `EquilibriumProblem` where they stand still.
        fastest_oscillation: angular frequency (rad/s) of its fastest oscillation by the effects'
            parameters; 0 if nothing swings.
        refused_effects: effects that would fit a port and mean nothing there, and why.
        absent_signals: why it has no other signals, and what to do with a log that has them.
        shipped_example: shipped model that a missing part can be copied from; "" for none.
        balances_loads: a muscle balances the load of the drive, so a load has an equilibrium and a
            person or a weight can act on it.
        is_free: nothing holds it: no command has an equilibrium, and a trial begins where its
            [start] says.
        has_muscle: it has one, with a pressure and limits of its own.
        is_diagnosable: it is a balance of forces that effects add to, as a diagnosis needs.
        needed_ports: port at which a model must have an effect for one to be missing at another,
            by that other: a rig without a regulator misses no lag of one.
        modifying_ports: ports whose effects do nothing but change what others do.
        moving_lags: states of sensors' lags whose quantity moves where a trial begins, and the
            state that is its rate.
        start_paths: parameters of a free rig that say where a trial begins, by the state that is
            there then: its position, then its speed.
        drive_port: port of the drive whose force moves a free rig.
        imposes_motion: its drive takes a record of positions, and forces follow from the motion.
        direct_commands: command that each of its drives takes as it comes, without a line of volts.
    """

    name: str
    signals: tuple[Signal, ...]
    ports: Mapping[str, Port]
    parts: tuple[str, ...]
    position_tolerances: Mapping[str, float]
    write_equations: Callable[[PlantEquations], None]
    solve_equilibrium: Callable[[EquilibriumProblem], None]
    fastest_oscillation: Callable[[Mapping[str, Parameters]], float]
    refused_effects: Mapping[str, str] = field(default_factory=dict)
    absent_signals: str = ""
    shipped_example: str = ""
    balances_loads: bool = False
    is_free: bool = False
    has_muscle: bool = True
    is_diagnosable: bool = False
    drive_port: str = ""
    imposes_motion: bool = False
    needed_ports: Mapping[str, str] = field(default_factory=dict)
    modifying_ports: tuple[str, ...] = ()
    moving_lags: Mapping[str, str] = field(default_factory=dict)
    start_paths: Mapping[str, str] = field(default_factory=dict)
    direct_commands: Mapping[str, str] = field(default_factory=dict)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of its signals, as its equations and trials call them."""
        return tuple(signal.name for signal in self.signals)
