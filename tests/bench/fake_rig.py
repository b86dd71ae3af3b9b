"""An emulated rig without a terminal or waiting: firmware, port and loop share a clock."""

from contextlib import contextmanager

from pma_gym.bench import ControlLoop, SerialRig, control_loop, read_rig_file
from pma_gym.bench.emulator import Firmware
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model, dump_model
from pma_gym.plant.plant import Plant

SLIDE = {
    "two_way_drive": {"gain_n_per_v": 100.0, "middle_v": 5.0},
    "slide": {"mass_kg": 5.0},
    "symmetric_damping": {"intercept_n_s_per_mm": 0.05, "slope_n_s_per_mm_per_kpa": 0.0},
    "start": {"contraction_mm": 0.0, "velocity_mm_per_s": 0.0},
    "lvdt": {"bandwidth_hz": 1000.0, "noise_mm": 0.01},
}
FRICTION = {
    "static_n": 12.0,
    "dynamic_n": 12.0,
    "stribeck_speed_mm_per_s": 5.0,
    "presliding_um": 10.0,
}
SLIDE_RIG = """
title = "A slide"
model = "slide.toml"
port = "{port}"
emulated_model = "hidden.toml"
rate_hz = 100
watchdog_ms = {watchdog}
[commands]
motor_voltage_v = {{range = [0, 10], rate = 1000, rest = 5}}
[measurements]
contraction_mm = {{range = [-80, 80], rate = 2000}}
[safe]
action = "{action}"
seconds = 0.5
"""
STATION_RIG = """
model = "station"
port = "/dev/rig"
rate_hz = 100
watchdog_ms = 1000
settle_s = 1.0
[commands]
motor_voltage_v = {range = [0, 10], rate = 50, rest = 0.1}
regulator_voltage_v = {range = [0, 8], rate = 20, rest = 0, start = 5}
[measurements]
contraction_mm = {range = [-20, 70]}
rotation_deg = {range = [-900, 900]}
load_n = {range = [-50, 900]}
pressure_kpa = {range = [-20, 650]}
[safe]
action = "vent"
"""
HOST = """
import signal, sys
from pathlib import Path
from pma_gym.bench import ControlLoop, TrialLog, open_rig, read_rig_file
rig = read_rig_file(Path(sys.argv[1]))
with open_rig(rig) as line, TrialLog(Path(sys.argv[2]), rig).trial() as write:
    def log(*row):
        write(*row)
        print(flush=True)
    ControlLoop(line, rig).run(60.0, lambda time, sample: [5.1], log)
"""


def write_slide(folder, port="/dev/rig", watchdog=1000, action="vent"):
    """Files of a slide that hides friction, and of its rig; the path of that."""
    parsed = {name: CATALOGUE[name].parse(table) for name, table in SLIDE.items()}
    model = Model("slide", "slide", "slide", parsed)
    (folder / "slide.toml").write_text(dump_model(model))
    hidden = model.with_effects({"coulomb_friction": FRICTION})
    (folder / "hidden.toml").write_text(dump_model(hidden))
    path = folder / "rig.toml"
    path.write_text(SLIDE_RIG.format(port=port, watchdog=watchdog, action=action))
    return path


class Clock:
    """Time that goes on where somebody sleeps."""

    def __init__(self):
        self.now = 10**9

    def monotonic_ns(self):
        return self.now

    def sleep(self, seconds):
        self.now += round(seconds * 1e9)


class FakePort:
    """A port with firmware behind it.

    `spoil` changes what the firmware answers.
    """

    def __init__(self, firmware, spoil=lambda answer: answer):
        self.firmware, self.spoil, self.answers, self.timeout = firmware, spoil, b"", 0.0

    def write(self, line):
        self.answers += self.spoil(self.firmware.answer(line.removesuffix(b"\n")))

    @property
    def in_waiting(self):
        return len(self.answers)

    def read(self, count):
        read, self.answers = self.answers[:count], self.answers[count:]
        return read


class FakeRig:
    """A rig's file, its firmware, host and loop, on one clock."""

    def __init__(self, path, monkeypatch, spoil=lambda answer: answer):
        self.file, self.clock = read_rig_file(path), Clock()
        monkeypatch.setattr(control_loop, "time", self.clock)
        plant = Plant(self.file.emulated_model or self.file.model)
        self.firmware = Firmware(plant, 0, self.clock.monotonic_ns)
        self.host = SerialRig(self.file, FakePort(self.firmware, spoil))
        self.loop = ControlLoop(self.host, self.file)

    @contextmanager
    def opened(self, file):
        """As `open_rig`."""
        yield self.host
