"""Experiments with a driven axis: loop, references, sensor, files."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.hidden_effects.rigs import effect_size, files
from benchmarks.hidden_effects.rigs.files import draw_names
from benchmarks.hidden_effects.rigs.laws import HiddenEffect
from benchmarks.hidden_effects.rigs.rig import (
    Reference,
    Rig,
    draw_joint,
    draw_lengths,
    draw_reference,
    draw_slide,
)
from benchmarks.hidden_effects.rigs.sensing import Sensor, draw_sensor
from benchmarks.hidden_effects.rigs.simulators import mujoco_axis, stick_slip
from benchmarks.hidden_effects.rigs.simulators.drive import Transmission
from benchmarks.hidden_effects.rigs.simulators.stick_slip import Motion

BITS = 16
"""Of the converter that commands go through."""

REACH = 4.0
"""Commands end at so many times the peak force of the axis."""


@dataclass
class Controller:
    """Source of commands for a simulation, which also reads the sensor of every row.

    Attributes:
        believed: the rig as the lab's model has it.
        reference: to follow.
        sensor: of the position.
        noise: of its every reading, shape (rows,).
        bandwidth: of the closed loop (Hz); 0 leaves it open.
        released: the loop closes at the end of the rest; else it holds the axis there too.
    """

    believed: Rig
    reference: Reference
    sensor: Sensor
    noise: np.ndarray
    bandwidth: float
    released: bool

    def __post_init__(self) -> None:
        self.readings: list[float] = []
        self.limit = REACH * self.believed.peak_force
        self.step = 2.0 * self.limit / 2**BITS
        self._slope = 0.0
        moving = self.reference.q != self.reference.q[0]
        self._closed_from = int(moving.argmax()) if self.released else 1

    def __call__(self, row: int, q: float) -> float:
        """Command of a row; q is the position in the row before it."""
        if row:
            self.read(q)
        force = self._forward(row)
        if self.bandwidth and row >= self._closed_from:
            force += self._feedback(row)
        return self.step * round(min(max(force, -self.limit), self.limit) / self.step)

    def read(self, q: float) -> None:
        """The next row's reading."""
        self.readings.append(self.sensor.reading(q, self.noise[len(self.readings)]))

    def _forward(self, row: int) -> float:
        rig, to = self.believed, self.reference
        force = rig.inertia * to.a[row] + rig.damping * to.v[row] + rig.stiffness * to.q[row]
        return float(force + rig.gravity * math.sin(to.q[row] + rig.gravity_angle))

    def _feedback(self, row: int) -> float:
        """Position and filtered speed; the reading is a row old."""
        omega, inertia = 2.0 * math.pi * self.bandwidth, self.believed.inertia
        interval = 1.0 / self.believed.rate
        error = self.reference.q[row - 1] - self.readings[-1]
        if len(self.readings) > 1:
            new = (self.readings[-1] - self.readings[-2]) / interval
            keep = math.exp(-5.0 * omega * interval)
            self._slope = keep * self._slope + (1.0 - keep) * new
        slow = self.reference.v[row - 1] - self._slope
        return inertia * omega * (omega * error + 1.4 * slow)


ERROR_SHARE = 0.1
"""Error of a simulated position at most, as a share of the sensor's noise."""

PILOT = 12.0
"""Seconds of the first file by which an effect's size is counted, and two periods."""

FARTHEST = 3.0
"""An open loop that leads farther than so many half strokes is closed."""

COLUMNS = {
    "slide": ("load_command_n", "contraction_mm", 1e3),
    "joint": ("torque_command_n_m", "angle_deg", math.degrees(1.0)),
}
"""Command, position, and the position's unit in SI units, by kind of rig."""


@dataclass(frozen=True)
class DrivenCampaign:
    """One rig and its files.

    Attributes:
        rig: the rig.
        believed: as the lab's model has it.
        sensor: of its position.
        references: of its files.
        repeats: by number of a file, from 0, the earlier one that it repeats.
        bandwidth: of its loop (Hz); 0 where it is open.
        simulator: what computes it, "own" or "MuJoCo".
        seed: of the noise.
    """

    rig: Rig
    believed: Rig
    sensor: Sensor
    references: Sequence[Reference]
    repeats: Mapping[int, int]
    bandwidth: float
    simulator: str
    seed: Sequence[int]

    def run(
        self, effects: Sequence[HiddenEffect], i: int, seconds: float = math.inf
    ) -> tuple[Motion, np.ndarray]:
        """True motion and the sensor's readings (m, rad) of file i, or of its first seconds."""
        reference = self.references[i]
        rows = int(min(len(reference.q), seconds * self.rig.rate))
        sensing = self.sensor, self.noise(i)
        rests = self._rests(effects)
        controller = Controller(self.believed, reference, *sensing, self.bandwidth, rests)
        start = float(reference.q[0])
        motion = self.motion(effects, controller, rows, start, math.isinf(seconds))
        controller.read(float(motion.q[-1]))
        return motion, np.array(controller.readings)

    def motion(
        self,
        effects: Sequence[HiddenEffect],
        source: stick_slip.Source,
        rows: int,
        start: float = 0.0,
        fine: bool = False,
    ) -> Motion:
        """The true motion under a source of commands, from rest.

        Args:
            effects: what the rig hides.
            source: of the commands.
            rows: of the log.
            start: position (m, rad).
            fine: steps of MuJoCo are short where dry friction is hidden.
        """
        rig, transmission = self.rig, Transmission()
        for each in effects:
            transmission = each.transmission(transmission)
        moved = rig, tuple(effects), transmission, source, rows, (start, 0.0)
        if self.simulator != "MuJoCo":
            return stick_slip.simulate(*moved)
        step = self._mujoco_step()
        if fine and any(each.kinetic(0.0, 0.0, rig.peak_force) for each in effects):
            step = mujoco_axis.dry_step(step, rows / rig.rate)
        return mujoco_axis.simulate(*moved, step)

    def ratio(self, effect: HiddenEffect) -> float:
        """Size r of an effect, by the beginning of the first file."""
        pilot, _ = self.run((effect,), 0, PILOT + 2.0 / self.rig.frequency)
        return effect_size.size(effect_size.change(self.rig, pilot), self.sensor.rms)

    def within_range(self, effects: Sequence[HiddenEffect]) -> "DrivenCampaign":
        """The same, with its loop closed where it would lead away without."""
        if self.bandwidth:
            return self
        motions = (self.run(effects, i)[0] for i in range(len(self.references)))
        far = max(float(np.abs(each.q).max()) for each in motions)
        if far <= FARTHEST * self.rig.travel:
            return self
        return replace(self, bandwidth=2.0 * self.rig.frequency, repeats={})

    def texts(self, effects: Sequence[HiddenEffect]) -> dict[str, str]:
        """Texts of the lab's folder by name."""
        command, position, factor = COLUMNS[self.rig.kind]
        sign = -1.0 if self.rig.kind == "slide" else 1.0
        tables, limit = [], 0.0
        for i in range(len(self.references)):
            motion, readings = self.run(effects, i)
            forces = sign * motion.command
            limit = max(limit, float(np.abs(forces).max()))
            tables.append(
                {
                    command: (forces, files.digits(2.0 * limit / 2**16)),
                    position: (factor * readings, files.digits(factor * self.sensor.step)),
                }
            )
        model = files.MODELS[self.rig.kind](self.believed, limit)
        # Without a repeat or a rest nothing but the sensor's data sheet says how much is noise.
        stated = (
            {} if self.repeats or self._rests(effects) else {position: factor * self.sensor.rms}
        )
        names = draw_names(np.random.default_rng((*self.seed, 11)))
        return files.folder(self.rig.rate, tables, self.repeats, model, stated, names)

    def truth(self) -> dict[str, Any]:
        """What nobody must read before the diagnosis is made, besides the effects."""
        _, position, factor = COLUMNS[self.rig.kind]
        return {
            "simulator": self.simulator,
            "rig": vars(self.rig),
            "believed": vars(self.believed),
            "loop_hz": self.bandwidth,
            "seconds": [len(each.q) / self.rig.rate for each in self.references],
            "sensor": {"kind": self.sensor.kind, "step": self.sensor.step * factor},
            "noise": {position: self.sensor.rms * factor},
            "true_besides": ["sensor_quantisation"]
            if self.sensor.step > self.sensor.noise.white
            else [],
            "noise_kinds": self.sensor.noise.names,
        }

    def _rests(self, effects: Sequence[HiddenEffect]) -> bool:
        """Whether it rests while its drive is off: where nothing else moves it."""
        pulled = any(each.force(0.0, 0.0, 0.0) for each in effects)
        return not pulled and not self.rig.gravity * math.sin(self.rig.gravity_angle)

    def _mujoco_step(self) -> float:
        """Longest step whose errors the sensor does not tell (s)."""
        return mujoco_axis.step_within(
            ERROR_SHARE * self.sensor.rms, self.rig.peak_force / self.rig.inertia
        )

    def noise(self, i: int) -> np.ndarray:
        """Noise of every reading of file i (m, rad)."""
        rng = np.random.default_rng((*self.seed, i, 7))
        return self.sensor.noise.draw(rng, np.arange(len(self.references[i].q)) / self.rig.rate)


def draw_driven(
    rng: np.random.Generator, kind: str, simulator: str, seed: Sequence[int]
) -> DrivenCampaign:
    """A campaign with a slide or a joint, whose numbers the lab knows to a tenth or so."""
    rig = draw_joint(rng) if kind == "joint" else draw_slide(rng, springs=False)
    believed = replace(
        rig,
        inertia=rig.inertia * rng.uniform(0.9, 1.1),
        damping=rig.damping * rng.uniform(0.85, 1.15),
        stiffness=rig.stiffness * rng.uniform(0.93, 1.07),
        gravity=rig.gravity * rng.uniform(0.93, 1.07),
    )
    has_support = bool(rig.stiffness or rig.gravity)
    opened = rng.random() < (0.5 if has_support else 0.15)
    bandwidth = 0.0 if opened else min(rig.frequency * rng.uniform(1.5, 4.0), rig.rate / 25.0)
    lengths = draw_lengths(rng, rig.rate, rig.frequency)
    if opened and not has_support:
        lengths = [max(5.0, min(8.0, each)) for each in lengths]
    references = [
        draw_reference(rng, rig.travel, rig.frequency, rig.rate, round(each * rig.rate))
        for each in lengths
    ]
    repeats = {}
    if opened and rng.random() < 0.85:
        references[1], repeats = references[0], {1: 0}
    sensor = draw_sensor(rng, rig)
    return DrivenCampaign(rig, believed, sensor, references, repeats, bandwidth, simulator, seed)
