"""Ports of the rigs beside the station, and the signals of every rig that users' laws may read.

A rig computes its signals one after the other, so a law reads those that are known at its port,
and a rate law all of the rig. `tests/effects/test_user_effects.py` checks these tables against the
rigs. The zero of a slide's position is free in every trial, so no law of a user reads it, but that
of dry friction.
"""

from pma_gym.effects.effect import ANTAGONIST, Effect, antagonist, signals
from pma_gym.effects.ports import EVERYTHING, SENSOR, SENSOR_DELAY, STATES, STATION_PORTS, Port
from pma_gym.effects.sensors.sensors import (
    ENCODER,
    FORCE_SENSOR,
    JOINT_SENSORS,
    LOAD_CELL,
    LVDT,
    PRESSURE_TRANSDUCER,
    SENSORS,
    TACHOMETER,
)

_DRIVEN = ("velocity", "drive_force")
_TURNING = ("position", "angle", "velocity", "spin", "drive_force")
_CARRYING = (*_TURNING, "carried_force")
_MOVED = ("position", "contraction", "velocity", "pressure")
_COUPLING = Port(
    "acceleration of the mass at the drive (m/s^2, rad/s^2)",
    most=1,
    signals=("acceleration",),
    absent="acceleration",
)
_DELAY, _LAG = ("load_asked", "motor_voltage"), ("load_command", "motor_voltage")

_SHAPE = Port(
    "force of the drive (N, N m), changed by one effect after the other",
    signals=("load", "velocity"),
    absent="load",
)

SLIDE_PORTS: dict[str, Port] = {
    "dry_friction": Port(
        "factor on the level of dry friction, multiplied",
        signals=("position", *_DRIVEN, "carried_force"),
        absent=1.0,
    ),
    "slide_force": Port(
        "force on the slide (N), added; positive in the direction of contraction",
        signals=(*_DRIVEN, "carried_force"),
        absent=0.0,
    ),
    "contact_force": Port(
        "force on the slide (N), added; positive in the direction of contraction",
        signals=_DRIVEN,
        absent=0.0,
    ),
    "muscle_damping": Port(
        "damping coefficient of the slide (N s/m), added", signals=_DRIVEN, absent=0.0
    ),
    "two_way_drive": Port("load that the drive asks for (N)", least=1, most=1),
    "drive_delay": Port(
        "load command that has reached the drive (N)", most=1, signals=_DELAY, absent="load_asked"
    ),
    "drive_lag": Port(
        "load that arrives at the slide (N)", most=1, signals=_LAG, absent="load_command"
    ),
    "two_way_shape": _SHAPE,
    "drive_gain": Port(
        "force of the drive besides (N), added; positive as the contraction grows",
        signals=_DRIVEN,
        absent=0.0,
    ),
    "drive_loss": Port(
        "force that the drive loses on its way (N), added; positive likewise",
        signals=(*_DRIVEN, "carried_force"),
        absent=0.0,
    ),
    "coupling": _COUPLING,
}
"""Ports of the slide, with the number of effects and the use of their results."""

MUSCLE_SENSORS = (LOAD_CELL, PRESSURE_TRANSDUCER)
"""Sensors of each muscle of a joint that muscles turn."""

JOINT_PORTS: dict[str, Port] = {
    "joint_drive": Port("torque of the drive or motor (N m)", least=1, most=1),
    "drive_delay": Port(
        "command that has reached the drive (N m, V)", most=1, signals=_DELAY, absent="load_asked"
    ),
    "drive_lag": Port(
        "command that arrives at the joint (N m, V)", most=1, signals=_LAG, absent="load_command"
    ),
    "two_way_shape": _SHAPE,
    "drive_gain": Port("torque of the drive besides (N m), added", signals=_TURNING, absent=0.0),
    "joint_drive_loss": Port(
        "torque that the drive loses on its way (N m), added", signals=_CARRYING, absent=0.0
    ),
    "joint_load": Port(
        "torque that the joint carries at rest (N m), added; positive likewise",
        signals=_TURNING,
        absent=0.0,
    ),
    "joint_dry_friction": Port(
        "factor on the level of dry friction, multiplied", signals=_CARRYING, absent=1.0
    ),
    "joint_torque": Port(
        "torque on the joint (N m), added; positive as the angle grows",
        signals=_CARRYING,
        absent=0.0,
    ),
    "coupling": _COUPLING,
}
"""Ports of the joint, with the number of effects and the use of their results."""

IMPOSED_PORTS: dict[str, Port] = {
    "imposed_motion": Port("acceleration of what the drive moves (m/s^2)", least=1, most=1),
    "muscle_force": Port(
        "force of the muscle (N), added; positive shortens it", signals=_MOVED, absent=0.0
    ),
    "contact_force": Port(
        "force on what moves (N), added; positive in the direction of contraction",
        signals=_MOVED,
        absent=0.0,
    ),
    "rod_force": Port(
        "force of piston, seal and guide (N), added; positive likewise", signals=_MOVED, absent=0.0
    ),
    "lost_motion": Port("way that is lost before what rubs (m)", most=1),
    "muscle_damping": Port(
        "damping coefficient of the slide (N s/m), added", signals=_MOVED, absent=0.0
    ),
    "damping_factor": Port(
        "factor on the damping coefficient, multiplied", signals=_MOVED, absent=1.0
    ),
    "chamber": STATION_PORTS["chamber"],
    "regulator_line": Port("pressure that the regulator settles at (Pa)", most=1),
    "regulator_delay": STATION_PORTS["regulator_delay"],
    "regulator_lag": Port("rate of the pressure (Pa/s)", most=1),
    "regulator_pace": STATION_PORTS["regulator_pace"],
}
"""Ports of the imposed motion, with the number of effects and the use of their results."""

_AIR = ("pressure", "pressure_asked", "pressure_command")
_FLOWING = ("opening_asked", "opening", "air_flow")
_PULLING = ("pressure", "contraction", "velocity")
_AT_JOINT = ("angle", "spin")

_MUSCLE_PORTS: dict[str, Port] = {
    "moment_arm": Port("contraction and moment arm of the muscle (m)", least=1, most=1),
    "muscle_force": STATION_PORTS["muscle_force"],
    "muscle_damping": Port(
        "damping coefficient of the muscle (N s/m), added", signals=_PULLING, absent=0.0
    ),
    "regulator_line": Port("pressure that is asked for (Pa)", most=1),
    "regulator_delay": STATION_PORTS["regulator_delay"],
    "regulator_lag": Port("rate of the pressure (Pa/s)", least=1, most=1),
    "regulator_pace": STATION_PORTS["regulator_pace"],
    "chamber": STATION_PORTS["chamber"],
    "valve_drive": Port("opening that is asked of the valve, -1 to 1", most=1),
    "valve_delay": Port(
        "opening that has reached the muscle", 0, 1, (), ("opening_asked",), "opening_asked"
    ),
    "valve_shape": Port(
        "that opening, changed by one effect after the other",
        signals=("opening", "pressure"),
        absent="opening",
    ),
    "air_flow": Port(
        "mass flow of air into the muscle (kg/s), added",
        signals=("opening", "pressure", "contraction"),
        absent=0.0,
    ),
}

SECOND_PORTS: tuple[str, ...] = (
    *_MUSCLE_PORTS,
    *(sensor.port for sensor in MUSCLE_SENSORS),
    *(sensor.port.replace(SENSOR, SENSOR_DELAY) for sensor in MUSCLE_SENSORS),
)
"""Ports that a second muscle has too, with the prefix `ANTAGONIST`."""

MUSCLE_JOINT_PORTS: dict[str, Port] = {
    **_MUSCLE_PORTS,
    "joint_drive": Port("torque of a drive or motor beside the muscle (N m)", most=1),
    **{
        name: JOINT_PORTS[name]
        for name in ("joint_drive_loss", "joint_load", "joint_dry_friction", "joint_torque")
    },
    "supply": Port("gauge pressure of the tank (Pa)", most=1),
}
"""Ports of a joint that a muscle turns, with the number of effects and the use of their results."""

MUSCLE_PAIR_PORTS: dict[str, Port] = {
    **MUSCLE_JOINT_PORTS,
    **{f"{ANTAGONIST}{name}": port for name, port in _MUSCLE_PORTS.items()},
    "co_contraction": Port("pressures that are asked of both muscles (Pa)", most=1),
}
"""Ports of a joint that two muscles turn, with the number of effects and the use of their results.

A law at a port of the second muscle reads that muscle's pressure, contraction and velocity, and an
angle that grows as it shortens.
"""

RATE_SIGNALS: dict[str, tuple[str, ...]] = {
    "station": EVERYTHING,
    "slide": (
        *(*_DRIVEN, "acceleration", "carried_force", "motor_voltage"),
        *("load_asked", "load_command", "load_arriving"),
    ),
    "joint": (*_CARRYING, "acceleration", "motor_voltage", "load_asked", "load_command"),
    "imposed": (*_MOVED, "pressure_asked", "pressure_command"),
    "cascade": (*_AIR, "regulator_voltage"),
    **dict.fromkeys(("muscle_joint", "muscle_pair"), (*_CARRYING, "contraction", *_AIR, *_FLOWING)),
}
"""Signals that rate laws may read, by rig."""


def _with_sensors(
    ports: dict[str, Port], sensors: tuple[Effect, ...], read: tuple[str, ...]
) -> dict[str, Port]:
    truth = Port("reading on top of the truth, added", signals=("signal", *read), absent=0.0)
    opened = {name: port for name, port in ports.items() if port.absent is not None}
    return opened | {sensor.port: truth for sensor in sensors}


OPEN_PORTS: dict[str, dict[str, Port]] = {
    "station": _with_sensors(STATION_PORTS, SENSORS, (*STATES, "cable_tension")),
    "slide": _with_sensors(SLIDE_PORTS, (LVDT, TACHOMETER), ("velocity",)),
    "joint": _with_sensors(JOINT_PORTS, JOINT_SENSORS, _TURNING),
    "cascade": _with_sensors(
        {name: STATION_PORTS[name] for name in ("regulator_delay", "regulator_pace")},
        SENSORS,
        ("pressure",),
    ),
    "imposed": _with_sensors(IMPOSED_PORTS, (LVDT, FORCE_SENSOR, PRESSURE_TRANSDUCER), _MOVED),
    "muscle_joint": _with_sensors(MUSCLE_JOINT_PORTS, (ENCODER, *MUSCLE_SENSORS), _AT_JOINT),
    "muscle_pair": _with_sensors(
        MUSCLE_PAIR_PORTS,
        (ENCODER, *MUSCLE_SENSORS, *map(antagonist, MUSCLE_SENSORS)),
        _AT_JOINT,
    ),
}
"""Ports where users can add effects, by rig."""


def rigs_of(port: str) -> list[str]:
    """Rigs with a port where users can add effects.

    >>> rigs_of("joint_torque")
    ['joint', 'muscle_joint', 'muscle_pair']
    """
    return [rig for rig, ports in OPEN_PORTS.items() if port in ports]


def unknown_signal(effect: Effect, rig: str) -> str:
    """Say which signal a user's law reads that a rig does not have at its port; empty if none."""
    port, path = OPEN_PORTS[rig][effect.port], ("memory", "travel", "direction")
    memory = ("memory",) if effect.rate or effect.rate_independent_law else ()
    rates = RATE_SIGNALS[rig]
    steps = [name for name in (*STATES, "stretch") if name in rates]
    known = [
        (effect.law, (*port.signals, *memory)),
        (effect.rate, (*rates, "memory")),
        (effect.rate_independent_law, path),
        (effect.path_breakpoint, ("memory", "direction")),
        (effect.event, steps),
        (effect.breakpoint, steps),
    ]
    for law, names in known:
        unknown = [name for name in signals(law) if name not in (*names, "p")] if law else []
        if law and unknown:
            return (
                f"has {law.__name__}({', '.join(signals(law))}); it cannot know "
                f"{', '.join(unknown)}; at port {effect.port} of a {rig} it may take "
                f"{', '.join(names)} and p"
            )
    return ""
