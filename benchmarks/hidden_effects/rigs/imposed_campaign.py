"""Experiments with a testing machine: imposed motions, measured forces."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from benchmarks.hidden_effects.rigs import files
from benchmarks.hidden_effects.rigs.laws import HiddenEffect
from benchmarks.hidden_effects.rigs.rig import (
    ImposedRig,
    Reference,
    draw_imposed,
    draw_lengths,
    draw_reference,
    log_uniform,
)
from benchmarks.hidden_effects.rigs.sensing import Sensor, draw_noise
from benchmarks.hidden_effects.rigs.simulators import imposed_force, mujoco_force

SIMULATORS = {"own": imposed_force.simulate, "MuJoCo": mujoco_force.simulate}
"""What computes the force."""

MOTION = "contraction_command_mm"
"""Column of an imposed motion, positive against q: pressure pushes the rod out."""

FORCE = "force_n"
"""Column of what the load cell reads."""

FINER = 10
"""Steps of a motion between two rows of its log: its speed is a difference over two of them, which
errs by a hundredth of what one over two rows does."""


@dataclass(frozen=True)
class ImposedCampaign:
    """One rig and its files.

    Attributes:
        rig: the rig.
        believed: as the lab's model has it.
        cell: the load cell (N).
        motions: of its files.
        repeats: by number of a file, from 0, the earlier one that it repeats.
        simulator: name of what computes it.
        seed: of the noise.
    """

    rig: ImposedRig
    believed: ImposedRig
    cell: Sensor
    motions: Sequence[Reference]
    repeats: Mapping[int, int]
    simulator: str
    seed: Sequence[int]

    def force(self, effects: Sequence[HiddenEffect], i: int) -> np.ndarray:
        """Of file i without noise (N), shape (rows,)."""
        simulate = SIMULATORS[self.simulator]
        return simulate(self.rig, tuple(effects), self.motions[i], self.rig.pressures[i])

    def ratio(self, effect: HiddenEffect) -> float:
        """Size r of an effect: what no refit of mass, damping, stiffness, area and zero can do."""
        changed = []
        for i, motion in enumerate(self.motions[:3]):
            without = self.force((), i)
            pressure = np.full(len(without), self.rig.pressures[i])
            known = [motion.a, motion.v, motion.q, pressure, np.ones(len(without))]
            changed.append(np.array([self.force((effect,), i) - without, *known]))
        change, *known = np.concatenate(changed, axis=1)
        table = np.array([each / (np.linalg.norm(each) or 1.0) for each in known]).T
        left = change - table @ np.linalg.lstsq(table, change, rcond=1e-10)[0]
        return float(np.sqrt(np.mean(left**2)) / self.cell.rms)

    def within_range(self, effects: Sequence[HiddenEffect]) -> "ImposedCampaign":
        """The same: the machine holds its motion against any force."""
        return self

    def tables(self, effects: Sequence[HiddenEffect]) -> list[files.Table]:
        """Columns of each file."""
        return [self._table(effects, i) for i in range(len(self.motions))]

    def texts(self, effects: Sequence[HiddenEffect]) -> dict[str, str]:
        """Texts of the lab's folder by name."""
        # Without a repeat nothing but the load cell's data sheet says how much is noise.
        stated = {} if self.repeats else {FORCE: self.cell.rms}
        model = files.imposed(self.believed)
        return files.folder(self.rig.rate, self.tables(effects), self.repeats, model, stated)

    def truth(self) -> dict[str, Any]:
        """What nobody must read before the diagnosis is made, besides the effects."""
        return {
            "simulator": self.simulator,
            "rig": vars(self.rig),
            "believed": vars(self.believed),
            "seconds": [len(each.q) / self.rig.rate for each in self.motions],
            "sensor": {"kind": self.cell.kind, "step": self.cell.step},
            "noise": {FORCE: self.cell.rms},
            "noise_kinds": self.cell.noise.names,
        }

    def _table(self, effects: Sequence[HiddenEffect], i: int) -> files.Table:
        rate = self.rig.rate
        # Dynamic testers take the inertia of what moves beyond the cell off, by an accelerometer.
        force = self.force(effects, i) - self.rig.mass * self.motions[i].a
        rng = np.random.default_rng((*self.seed, i, 7))
        read = force + self.cell.noise.draw(rng, np.arange(len(force)) / rate)
        read = self.cell.step * np.round(read / self.cell.step)
        motion = -1e3 * self.motions[i].q
        table = {MOTION: (motion, files.digits(1e-6 * 1e3 * self.rig.travel))}
        if self.rig.area:
            table["pressure_command_kpa"] = (np.full(len(force), self.rig.pressures[i] / 1e3), 1)
        return table | {FORCE: (read, files.digits(self.cell.step))}


def draw_tested(
    rng: np.random.Generator, kind: str, simulator: str, seed: Sequence[int]
) -> ImposedCampaign:
    """A campaign with a seal, a brake or a spring."""
    count = int(rng.integers(3, 7))
    rig = draw_imposed(rng, count)
    lengths = draw_lengths(rng, rig.rate, rig.frequency)
    lengths = [lengths[i % len(lengths)] for i in range(count)]
    motions = [
        _turned(rig, draw_reference(rng, rig.travel, rig.frequency, FINER * rig.rate, steps))
        for steps in (FINER * round(each * rig.rate) for each in lengths)
    ]
    repeats = {}
    if rng.random() < 0.8:
        motions[1], repeats = motions[0], {1: 0}
        rig = replace(rig, pressures=(rig.pressures[0], rig.pressures[0], *rig.pressures[2:]))
    believed = replace(
        rig,
        damping=rig.damping * rng.uniform(0.85, 1.15),
        stiffness=rig.stiffness * rng.uniform(0.93, 1.07),
        area=rig.area * rng.uniform(0.97, 1.03),
    )
    white = rig.peak_force * log_uniform(rng, 3e-4, 3e-2)
    cell = Sensor("load cell", white * rng.uniform(0.1, 1.0), draw_noise(rng, white))
    return ImposedCampaign(rig, believed, cell, motions, repeats, simulator, seed)


def _turned(rig: ImposedRig, motion: Reference) -> Reference:
    """Rows of a motion as a machine of finite bandwidth makes it, from rest: no jumps of speed.

    It ends a little earlier, since what would come after its end is not known.
    """
    steps = FINER * rig.rate / (2.0 * np.pi * rig.bandwidth)
    kept = slice(0, len(motion.q) - int(4.0 * steps + 1.0), FINER)
    return Reference(
        *(gaussian_filter1d(x, steps, mode="nearest")[kept] for x in vars(motion).values())
    )
