"""Effects that can be hidden: typical numbers, scaling of size, simulator.

Parameters bear the catalogue's names and units where it has the same law. No import of pma_gym.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.hidden_effects.physics import drive, muscle, outside
from benchmarks.hidden_effects.physics.rig import Array, Hidden

Values = Mapping[str, float]
Columns = Mapping[str, Array]
DEGREE = np.pi / 180.0


@dataclass(frozen=True)
class Kind:
    """An effect that can be hidden.

    Attributes:
        draw: typical parameters from a generator and the largest load (N) of the trials.
        size: parameters that grow with its size, in proportion.
        build: the effect from parameters of every lane.
        most: size beyond which it would be absurd.
        inverse: parameters that shrink with its size.
        sized: whether it can be of any size; else it is typical, and its ratio what it is.
    """

    draw: Callable[[np.random.Generator, float], dict[str, float]]
    size: tuple[str, ...]
    build: Callable[[Columns], Hidden]
    most: float = 8.0
    inverse: tuple[str, ...] = ()
    sized: bool = True

    def at(self, typical: Values, size: float) -> dict[str, float]:
        """Parameters at a size; 0 is no effect, 1 typical."""
        out = dict(typical)
        for name in self.size:
            out[name] = typical[name] * size
        for name in self.inverse:
            out[name] = typical[name] / size if size else 1e12
        return out


def one(column: Array) -> float:
    """A parameter that all lanes share."""
    return float(column[0])


def _log(g: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(g.uniform(np.log(low), np.log(high))))


def _sign(g: np.random.Generator) -> float:
    return float(g.choice([-1.0, 1.0]))


def _slow(signal: int, low: float, high: float) -> Kind:
    """A sensor that is late by some ms more than its data sheet says."""
    return Kind(
        lambda g, most: {"longer_ms": _log(g, low, high)},
        ("longer_ms",),
        lambda p: outside.SlowSensor(signal, p["longer_ms"] * 1e-3),
        10.0,
    )


def _friction(by_pressure: float) -> Callable[[Columns], Hidden]:
    return lambda p: muscle.SlideFriction(
        p["dynamic_n"],
        one(p["presliding_um"]) * 1e-6,
        one(p["breakaway"]),
        one(p["stribeck_speed_mm_per_s"]) * 1e-3,
        by_pressure,
    )


def _dashpots(p: Columns) -> Hidden:
    time, spread = one(p["time_constant_s"]), one(p["spread"])
    return muscle.Dashpots(p["stiffness_n_per_mm"] * 1e3, (time / spread, time * spread))


def _draw_friction(g: np.random.Generator, most: float) -> dict[str, float]:
    return {
        "dynamic_n": _log(g, 2.0, 15.0),
        "breakaway": float(g.uniform(1.0, 1.4)),
        "stribeck_speed_mm_per_s": _log(g, 1.0, 10.0),
        "presliding_um": _log(g, 5.0, 30.0),
    }


KINDS: dict[str, Kind] = {
    "nonlinear_stiffness": Kind(
        lambda g, most: {
            "curvature": _sign(g) * g.uniform(0.4, 2.0),
            "growth": _sign(g) * g.uniform(1.0, 8.0),
        },
        ("curvature",),
        lambda p: muscle.BentSpring(p["curvature"], one(p["growth"])),
        2.0,
    ),
    "passive_stretch": Kind(
        lambda g, most: {"factor": g.uniform(0.5, 1.5)},
        ("factor",),
        lambda p: muscle.Overstretch(p["factor"]),
        2.0,
    ),
    "load_dependent_damping": Kind(
        lambda g, most: (lambda peak: {"linear": peak, "quadratic": -peak * g.uniform(0.8, 1.1)})(
            g.uniform(3.0, 12.0)
        ),
        ("linear", "quadratic"),
        lambda p: muscle.LoadedDamping(p["linear"], p["quadratic"]),
        2.0,
    ),
    "regulator_asymmetry": Kind(
        lambda g, most: {"excess": _sign(g) * _log(g, 0.2, 0.5)},
        ("excess",),
        lambda p: drive.SlowVent(np.exp(p["excess"])),
        4.0,
    ),
    "regulator_rate_limit": Kind(
        lambda g, most: {"limit_kpa_per_s": _log(g, 600.0, 3000.0)},
        (),
        lambda p: drive.NarrowValve(p["limit_kpa_per_s"] * 1e3),
        20.0,
        ("limit_kpa_per_s",),
    ),
    "regulator_delay": Kind(
        lambda g, most: {"delay_ms": _log(g, 10.0, 30.0)},
        ("delay_ms",),
        lambda p: drive.LateValve(p["delay_ms"] * 1e-3),
        4.0,
    ),
    "regulator_deadband": Kind(
        lambda g, most: {"width_kpa": _log(g, 1.0, 5.0)},
        ("width_kpa",),
        lambda p: drive.LazyValve(p["width_kpa"] * 1e3),
        4.0,
    ),
    "hysteresis": Kind(
        lambda g, most: {"force_n": _log(g, 15.0, 40.0), "distance_mm": _log(g, 1.0, 2.5)},
        ("force_n",),
        lambda p: muscle.MaxwellSlip(p["force_n"], one(p["distance_mm"]) * 1e-3),
    ),
    "creep": Kind(
        lambda g, most: {
            "stiffness_n_per_mm": _log(g, 0.2, 1.5),
            "time_constant_s": _log(g, 1.0, 3.0),
            "spread": float(g.uniform(1.0, 1.6)),
        },
        ("stiffness_n_per_mm",),
        _dashpots,
    ),
    "slow_creep": Kind(
        lambda g, most: {
            "stiffness_n_per_mm": _log(g, 0.3, 2.0),
            "time_constant_s": _log(g, 20.0, 60.0),
            "spread": float(g.uniform(1.0, 1.6)),
        },
        ("stiffness_n_per_mm",),
        _dashpots,
    ),
    "coulomb_friction": Kind(_draw_friction, ("dynamic_n",), _friction(0.0), 6.0),
    "bearing_friction": Kind(
        lambda g, most: {"force_n": _log(g, 2.0, 10.0), "presliding_um": _log(g, 20.0, 100.0)},
        ("force_n",),
        lambda p: drive.BearingFriction(p["force_n"], one(p["presliding_um"]) * 1e-6),
        6.0,
    ),
    "filling": Kind(
        lambda g, most: {"exponent": g.uniform(0.8, 1.4)},
        ("exponent",),
        lambda p: drive.Squeeze(p["exponent"], 0.25, 0.02, 2.085),
        1.2,
    ),
    "warm_up": Kind(
        lambda g, most: {"force_at_200_kpa_n": _log(g, 5.0, 30.0), "half_life": g.uniform(1, 3)},
        ("force_at_200_kpa_n",),
        lambda p: muscle.WarmUp(p["force_at_200_kpa_n"], one(p["half_life"])),
        8.0,
    ),
    "cable_slack": Kind(
        lambda g, most: {"slack_mm": _log(g, 0.3, 2.0)},
        ("slack_mm",),
        lambda p: drive.Slack(p["slack_mm"] * 1e-3),
        5.0,
    ),
    "drive_dead_zone": Kind(
        lambda g, most: {"width_n": _log(g, 5.0, 20.0), "slope": g.uniform(1.8, 2.4)},
        ("width_n",),
        lambda p: drive.DeadBand(p["width_n"], one(p["slope"])),
        10.0,
    ),
    "drive_saturation": Kind(
        lambda g, most: {"most_n": most, "cut_n": _log(g, 15.0, 60.0)},
        ("cut_n",),
        lambda p: drive.CurrentLimit(np.where(p["cut_n"] > 0, p["most_n"] - p["cut_n"], 1e6)),
        10.0,
    ),
    "drive_lag": Kind(
        lambda g, most: {"time_constant_ms": _log(g, 4.0, 20.0)},
        ("time_constant_ms",),
        lambda p: drive.CurrentLag(p["time_constant_ms"] * 1e-3),
        10.0,
    ),
    "drive_delay": Kind(
        lambda g, most: {"delay_ms": _log(g, 5.0, 25.0)},
        ("delay_ms",),
        lambda p: drive.CommandDelay(p["delay_ms"] * 1e-3),
    ),
    "torque_ripple": Kind(
        lambda g, most: {
            "amplitude_percent": _log(g, 0.2, 1.0),
            "periods": float(g.integers(6, 37)),
            "phase_deg": g.uniform(-180.0, 180.0),
        },
        ("amplitude_percent",),
        lambda p: drive.Ripple(
            p["amplitude_percent"] * 1e-2, one(p["periods"]), one(p["phase_deg"]) * DEGREE
        ),
        5.0,
    ),
    "current_imbalance": Kind(
        lambda g, most: {
            "amplitude_percent": _log(g, 1.0, 4.0),
            "periods": 2.0 * float(g.integers(1, 5)),
            "phase_deg": g.uniform(-180.0, 180.0),
        },
        ("amplitude_percent",),
        lambda p: drive.Imbalance(
            p["amplitude_percent"] * 1e-2, one(p["periods"]), one(p["phase_deg"]) * DEGREE
        ),
        5.0,
    ),
    "potentiometer_backlash": Kind(
        lambda g, most: {"width_deg": _log(g, 0.3, 2.0)},
        ("width_deg",),
        lambda p: outside.LooseSensor(p["width_deg"] * DEGREE),
    ),
    "lvdt_lag": _slow(0, 5.0, 30.0),
    "potentiometer_lag": _slow(1, 5.0, 30.0),
    "load_cell_lag": _slow(2, 5.0, 30.0),
    "pressure_transducer_lag": _slow(3, 10.0, 40.0),
    "sensor_quantisation": Kind(
        lambda g, most: {"signal": float(g.integers(4)), "daq_steps": float(g.integers(2, 9))},
        ("daq_steps",),
        lambda p: outside.CoarseSensor(int(one(p["signal"])), p["daq_steps"]),
        sized=False,
    ),
}
"""Effects of the catalogue by name."""

OUTSIDE: dict[str, Kind] = {
    "force_bump": Kind(
        lambda g, most: {
            "height_n": _sign(g) * _log(g, 10.0, 40.0),
            "at_mm": g.uniform(8.0, 35.0),
            "width_mm": _log(g, 1.0, 4.0),
        },
        ("height_n",),
        lambda p: outside.Bump(p["height_n"], one(p["at_mm"]) * 1e-3, one(p["width_mm"]) * 1e-3),
    ),
    "periodic_force": Kind(
        lambda g, most: {
            "height_n": _log(g, 5.0, 20.0),
            "period_mm": _log(g, 2.0, 8.0),
            "phase_deg": g.uniform(-180.0, 180.0),
        },
        ("height_n",),
        lambda p: outside.Teeth(
            p["height_n"], one(p["period_mm"]) * 1e-3, one(p["phase_deg"]) * DEGREE
        ),
    ),
    "pressure_friction": Kind(_draw_friction, ("dynamic_n",), _friction(3.0), 6.0),
    "frame_resonance": Kind(
        lambda g, most: {"gain_mm_per_n": _log(g, 1e-3, 1e-2), "hertz": _log(g, 2.0, 10.0)},
        ("gain_mm_per_n",),
        lambda p: outside.Resonance(p["gain_mm_per_n"] * 1e-3, 2, 0, one(p["hertz"]), 0.04),
        30.0,
    ),
    "hose_resonance": Kind(
        lambda g, most: {"gain": _log(g, 0.05, 0.5), "hertz": _log(g, 3.0, 12.0)},
        ("gain",),
        lambda p: outside.Resonance(p["gain"], 3, 3, one(p["hertz"]), 0.04),
    ),
    "load_cell_tilt": Kind(
        lambda g, most: {"percent_per_mm": _sign(g) * _log(g, 0.05, 0.5)},
        ("percent_per_mm",),
        lambda p: outside.TiltedLoadCell(p["percent_per_mm"] * 10.0),
        20.0,
    ),
    "potentiometer_eccentricity": Kind(
        lambda g, most: {"height_deg": _log(g, 0.3, 3.0), "phase_deg": g.uniform(-180.0, 180.0)},
        ("height_deg",),
        lambda p: outside.EccentricPotentiometer(
            p["height_deg"] * DEGREE, one(p["phase_deg"]) * DEGREE
        ),
    ),
    "compressor_beat": Kind(
        lambda g, most: {"height_kpa": _log(g, 1.0, 6.0), "hertz": _log(g, 0.5, 3.0)},
        ("height_kpa",),
        lambda p: outside.CompressorBeat(p["height_kpa"] * 1e3, one(p["hertz"])),
    ),
    "drive_bow": Kind(
        lambda g, most: {"bow_n": _sign(g) * _log(g, 2.0, 20.0), "most_n": most},
        ("bow_n",),
        lambda p: outside.BowedDrive(p["bow_n"], one(p["most_n"])),
    ),
}
"""Effects that no catalogue has, by name."""

LEAKAGE: dict[str, Kind] = {
    "leakage": Kind(
        lambda g, most: {"rate_per_s": _log(g, 0.02, 0.2), "opening_s": _log(g, 2.0, 10.0)},
        ("rate_per_s",),
        lambda p: drive.OpeningLeak(p["rate_per_s"], one(p["opening_s"])),
    ),
}
"""Effects outside the catalogue that only block `slow_drift` hides."""

ALL = KINDS | OUTSIDE | LEAKAGE
