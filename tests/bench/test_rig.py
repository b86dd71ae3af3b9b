"""Rigs on a serial line: limits, watchdogs, logs; most of it on an emulator without waiting."""

import itertools
import math
import os
import random
import select
import signal
import subprocess
import sys
import threading
import time
import tty
from contextlib import contextmanager, suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

import benchmarks.__main__
import pma_gym.bench
from pma_gym.bench import ControlLoop, RigError, TrialLog, open_rig, read_rig_file
from pma_gym.bench.emulator import Firmware
from pma_gym.bench.line_format import LONGEST, LineBuffer, decoded, encoded
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.discovery import diagnose
from pma_gym.plant.plant import Plant
from pma_gym.tasks import TASKS
from tests.bench.fake_rig import HOST, STATION_RIG, Clock, FakeRig, write_slide

SIGNALS = {"kill": signal.SIGKILL, "interrupt": signal.SIGINT}
SAFE_NS = 100_000_000
"""Time after which a rig without a host is safe."""


def push_and_pull(time, sample):
    """Up to 40 N either way, so that a slide turns and stops."""
    return [5.0 + 0.3 * math.cos(20.0 * time) + 0.1 * math.cos(9.0 * time)]


@pytest.mark.parametrize(
    ("line", "rule"),
    [
        (b"\xff\x00", "four hexadecimal digits"),
        (b"R 7*0000", "checksum must be BC60"),
        (b"R" * 10_000, "shorter than"),
        (b"R 7*BC60*BC60", "four hexadecimal digits"),
        (b"", "four hexadecimal digits"),
    ],
)
def test_a_line_of_a_stranger_is_refused_by_its_rule(line, rule):
    assert decoded(encoded("R", 7)[:-1]) == ["R", "7"]
    with pytest.raises(RigError, match=rule):
        decoded(line)


def test_a_line_without_an_end_takes_no_memory():
    buffer = LineBuffer()
    assert all(not buffer.lines(b"x" * 10_000) for _ in range(100))
    assert [len(line) for line in buffer.lines(b"\nI*\n")] == [LONGEST, 2]


@pytest.fixture(scope="module")
def slide(tmp_path_factory):
    folder = tmp_path_factory.mktemp("slide")
    write_slide(folder)
    return Plant(folder / "hidden.toml")


def armed(plant, ramp_ms):
    """Firmware under 9 V with a watchdog of 50 ms, and its clock."""
    clock = Clock()
    firmware = Firmware(plant, 0, clock.monotonic_ns)
    assert firmware.answer(encoded("A", 50, ramp_ms, 5.0)[:-1]) == encoded("A", "ok")
    assert firmware.answer(encoded("C", 9.0)[:-1]) == b""
    assert not firmware.is_safe and firmware.commands == [9.0]
    return firmware, clock


@settings(max_examples=40, deadline=None)
@given(st.lists(st.binary(max_size=40) | st.text("ACIMRS 0123456789.-e", max_size=30), max_size=20))
def test_whatever_arrives_firmware_answers_a_line_and_its_watchdog_acts(slide, lines):
    firmware, clock = armed(slide, 0)
    for line in lines:
        raw = line if isinstance(line, bytes) else encoded(*line.split(" "))[:-1]
        answer = firmware.answer(raw)
        assert not answer or decoded(answer[:-1])
    clock.sleep(1.1)
    firmware.advance()
    assert firmware.is_safe and math.isfinite(firmware.commands[0])


@pytest.mark.parametrize(
    ("ramp_ms", "after"), [(0, (5.0, 5.0)), (-1, (9.0, 9.0)), (1000, (7.0, 5.0))]
)
def test_without_commands_a_rig_vents_holds_or_ramps(slide, ramp_ms, after):
    firmware, clock = armed(slide, ramp_ms)
    clock.sleep(0.049)
    firmware.advance()
    assert not firmware.is_safe
    for seconds, volts in zip((0.501, 0.6), after, strict=True):
        clock.sleep(seconds)
        firmware.advance()
        assert firmware.is_safe and firmware.commands == pytest.approx([volts], abs=0.03)
    firmware.answer(encoded("C", 9.0)[:-1])
    assert firmware.commands == pytest.approx([after[1]])


def test_a_log_is_a_data_set_that_the_rigs_own_model_predicts(tmp_path, monkeypatch):
    """The logged commands, simulated with the friction that is hidden, give the logged readings."""
    rig, log = FakeRig(write_slide(tmp_path), monkeypatch), tmp_path / "log"
    for _ in range(2):
        with TrialLog(log, rig.file).trial() as write:
            rig.loop.run(1.5, push_and_pull, write)
    dataset = read_dataset(log)
    assert not dataset.checked and len(dataset.trials) == 2
    trial = dataset.trials[0].trial
    assert len(trial) == 150 and set(trial.measurements) == {"contraction"}
    errors = {}
    for name in ("hidden", "slide"):
        again = Plant(tmp_path / f"{name}.toml").simulate(trial, noise=False, interpolation="zoh")
        error = again.measurements["contraction"] - trial.measurements["contraction"]
        errors[name] = float(np.std(error))
    assert errors["hidden"] < 2.5e-5 < 20 * errors["hidden"] < errors["slide"]
    times = np.genfromtxt(log / "timing" / "trial-001.csv", delimiter=",", names=True)
    assert times["step"].tolist() == list(range(150)) and np.nanmax(times["command_delay_us"]) == 0


def late(rig):
    rig.clock.sleep(2.0)
    return [5.0]


def busy(rig):
    end = time.monotonic() + 5.0
    while time.monotonic() < end:
        pass
    return [5.0]


@pytest.mark.parametrize(
    ("old", "new", "act", "message"),
    [
        ("[-80, 80]", "[-2, 2]", lambda rig: [9.0], "contraction_mm must lie in -2 to 2, step"),
        ("rate = 2000", "rate = 90", lambda rig: [9.0], "contraction_mm must change by at most 90"),
        ("", "", lambda rig: [math.nan], "motor_voltage_v must be a finite number, the contr"),
        ("", "", late, "is in its safe state: no command arrived for 1000 ms"),
        ("= 1000\n", "= 50\n", busy, "no command in time for the watchdog"),
    ],
)
def test_what_breaks_a_limit_ends_in_the_safe_state(old, new, act, message, tmp_path, monkeypatch):
    path = write_slide(tmp_path)
    path.write_text(path.read_text().replace(old, new))
    rig = FakeRig(path, monkeypatch)
    with pytest.raises(RigError, match=message):
        rig.loop.run(5.0, lambda time, sample: act(rig))
    assert rig.firmware.is_safe and rig.firmware.commands == [5.0] or act is not late
    rig.clock.sleep(0.01)
    rig.firmware.advance()
    assert rig.firmware.is_safe and rig.firmware.commands == [5.0]


def test_commands_keep_their_range_and_rate(tmp_path, monkeypatch):
    path = write_slide(tmp_path)
    path.write_text(path.read_text().replace("[0, 10], rate = 1000", "[4, 6], rate = 50"))
    rig, rows = FakeRig(path, monkeypatch), []
    rig.loop.run(0.05, lambda time, sample: [99.0], lambda *row: rows.append(row[1][0]))
    assert rows == [5.5, 6.0, 6.0, 6.0, 6.0]


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (b"", "no answer to R within 50 ms"),
        (b"M 1 2\n", "line 5 from the rig: a line must be words.*got b'M 1 2'"),
        (b"\xfe" * 5000 + b"\n", "line 5 from the rig: a line must be shorter than 240 bytes"),
        (encoded("M", 3, 1, "nan", 0, 5.0, 0.0), "there must be 5 numbers, got '1 nan 0 5 0'"),
        (encoded("E", "no", "air"), "the rig refuses R: no air"),
        (OSError("unplugged"), "the line is lost: unplugged"),
    ],
)
def test_a_line_that_fails_is_said_with_what_came(answer, message, tmp_path, monkeypatch):
    def spoil(line):
        if not line.startswith(b"M 3 "):
            return line
        if isinstance(answer, OSError):
            raise answer
        return answer

    rig = FakeRig(write_slide(tmp_path, watchdog=50), monkeypatch, spoil)
    monkeypatch.setattr(pma_gym.bench.control_loop, "_alarm", lambda seconds: None)
    with pytest.raises(RigError, match=message):
        rig.loop.run(5.0, push_and_pull)
    assert rig.firmware.is_safe


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("range", "ranges", "keys are range, rate, rest, start, got 'ranges'"),
        ("rest = 5", "rest = 11", "commands.motor_voltage_v: 11 must lie in its range, 0 to 10"),
        ('"vent"', '"pray"', "safe.action must be vent, hold, ramp"),
        ("watchdog_ms = 1000", "watchdog_ms = 15", "watchdog_ms in two periods to 1000 ms"),
        ("[-80, 80]", "[80, -80]", "measurements.contraction_mm.range must be two numbers"),
        ("contraction_mm", "contracton_mm", "columns of trials, got 'contracton_mm'"),
        ("rate = 1000", "rate = 0", "motor_voltage_v.rate must be positive"),
        ("rate_hz = 100", "", "rate_hz is missing"),
    ],
)
def test_a_rigs_file_that_breaks_a_rule_is_refused(old, new, message, tmp_path):
    path = write_slide(tmp_path)
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(RigError, match=message) as error:
        read_rig_file(path)
    assert str(error.value).startswith(str(path))


@pytest.mark.parametrize("controller", ["pid", "ppo"])
def test_a_controller_drives_a_rig_as_it_drives_a_simulation(controller, tmp_path, monkeypatch):
    path = tmp_path / "rig.toml"
    path.write_text(STATION_RIG)
    rig = FakeRig(path, monkeypatch)
    monkeypatch.setattr(pma_gym.bench, "open_rig", rig.opened)
    words = ["rig", str(path), "--controller", controller, "--task", "displacement"]
    result = CliRunner().invoke(
        benchmarks.__main__.app, [*words, "--out", str(tmp_path / "log")], catch_exceptions=False
    )
    assert result.exit_code == 0 and "p99.9" in result.output
    assert rig.firmware.is_safe
    trial = read_dataset(tmp_path / "log").trials[0].trial
    ideal = TASKS["displacement"].schedule.reference(trial.time)
    assert float(np.sqrt(np.mean((trial.extension - ideal) ** 2))) < 0.4e-3


class Emulator:
    """An emulator's process and a line to it that can be cut, or speak nonsense."""

    def __init__(self, folder):
        command = [sys.executable, "-m", "pma_gym.bench.emulator", folder / "hidden.toml"]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        self.process = subprocess.Popen(command, **pipes)
        name = self.line(60.0).split()[1]
        self._far = os.open(name, os.O_RDWR | os.O_NOCTTY)
        self._near, other = os.openpty()
        tty.setraw(other)
        self.port, self.is_cut, self.noise = os.ttyname(other), False, b""
        self._ends = [other]
        threading.Thread(target=self._relay, daemon=True).start()

    def line(self, seconds):
        """Its next line of text."""
        assert self.process.stdout
        ready, _, _ = select.select([self.process.stdout], [], [], seconds)
        assert ready, "the emulator says nothing"
        return self.process.stdout.readline().decode()

    def _relay(self):
        with suppress(OSError):
            while True:
                ready, _, _ = select.select([self._far, self._near], [], [], 0.01)
                for end in ready:
                    received = self.noise or os.read(end, 4096)
                    if self.noise:
                        os.read(end, 4096)
                    if not self.is_cut:
                        os.write(self._near if end == self._far else self._far, received)

    def close(self):
        """End it."""
        assert self.process.stdin and self.process.stdout
        self.process.stdin.close()
        self.process.wait(20.0)
        self.process.stdout.close()
        for end in (self._far, self._near, *self._ends):
            os.close(end)


@contextmanager
def emulated(folder):
    emulator = Emulator(folder)
    try:
        yield emulator
    finally:
        emulator.close()


def killed(number, path, log, rows):
    """Send a signal to a host after some rows; the time at which it happened (ns)."""
    command = [sys.executable, "-c", HOST, path, log]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, **pipes) as host:
        assert host.stdout
        count = sum(bool(host.stdout.readline()) for _ in range(rows))
        when = time.monotonic_ns()
        host.send_signal(number)
    return when if count == rows else 0


def disturbed(how, emulator, path, log, rows):
    """Cut the line after some rows, or fill it with noise; when that happened (ns)."""
    rig, counter, when = read_rig_file(path), itertools.count(), 0

    def act(now, sample):
        nonlocal when
        if next(counter) == rows:
            when = time.monotonic_ns()
            emulator.is_cut = how == "cut"
            emulator.noise = b"" if how == "cut" else random.Random(rows).randbytes(99) + b"\n"
        return [5.1]

    with open_rig(rig) as line, TrialLog(log, rig).trial() as write, pytest.raises(RigError):
        ControlLoop(line, rig).run(60.0, act, write)
    emulator.is_cut, emulator.noise = False, b""
    return when


def broken_runs(folder, ways, watchdog, within):
    """Break runs of one emulator; each makes it safe in time and leaves a log that can be read."""
    log = folder / "log"
    write_slide(folder)
    with emulated(folder) as emulator:
        path = write_slide(folder, emulator.port, watchdog, action="ramp")
        for number, how in enumerate(ways):
            rows, when = 5 + number % 7, 0
            # On a machine with much to do a watchdog may act before the run is broken.
            for _ in range(9):
                if when:
                    break
                if how in SIGNALS:
                    when = killed(SIGNALS[how], path, log, rows)
                else:
                    when = disturbed(how, emulator, path, log, rows)
                word, safe = emulator.line(20.0).split()
                assert word == "safe" and int(safe) - when < within or not when, (how, number)
            assert when, (how, number)
            last = max(log.glob("*.csv"))
            assert last.read_bytes().endswith(b"\n")
            trials = {each.name: each.trial for each in read_dataset(log).trials}
            assert len(trials[last.name]) >= rows - 1


def test_a_killed_host_a_cut_line_and_noise_leave_a_safe_rig_and_a_log(tmp_path):
    # Wide: a loaded machine, not the watchdog, takes this long.
    broken_runs(tmp_path, ["kill", "cut", "noise", "interrupt"], 200, 50 * SAFE_NS)


@pytest.mark.campaign
def test_fifty_broken_runs_are_safe_within_a_tenth_of_a_second(tmp_path):
    ways = itertools.islice(itertools.cycle(["kill", "cut", "noise", "interrupt"]), 50)
    broken_runs(tmp_path, ways, 50, SAFE_NS)


CONTROLLER = '''
import math

class SlidePD:
    """Pull along a reference and shake at 2 Hz, so that inertia shows; 5 V are no force."""

    name = "slide_pd"

    def reset(self, reference, station):
        self.reference, self.period, self.last = reference, station.period, 0.0

    def act(self, measurement, time):
        error = self.reference(time) - measurement.extension
        change, self.last = (error - self.last) / self.period, error
        volts = 5.0 + 20.0 * error + 1.5 * change + 0.4 * math.sin(4.0 * math.pi * time)
        return min(max(volts, 0.0), 10.0)
'''


@pytest.mark.campaign
def test_friction_that_a_rig_hides_is_named_from_its_logs_as_they_are(tmp_path):
    path = write_slide(tmp_path, "emulator", watchdog=500)
    (tmp_path / "mine.py").write_text(CONTROLLER)
    words = ["--controller", f"{tmp_path}/mine.py:SlidePD", "--task", "multisine,multisine_2"]
    command = [sys.executable, "-m", "benchmarks", "rig", path, *words, "--out", tmp_path / "log"]
    subprocess.run(command, check=True)
    dataset = read_dataset(tmp_path / "log")
    diagnosis = diagnose(dataset, propose=False)
    assert "coulomb_friction" in [effect.name for effect in diagnosis.effects]
    # At 20 mm/s: which part of it is static, slow or fast motion alone would tell.
    p = diagnosis.model.parameters["coulomb_friction"]
    force = p.dynamic + (p.static - p.dynamic) / (1.0 + (20e-3 / p.stribeck_speed) ** 2)
    assert force == pytest.approx(12.0, rel=0.15), diagnosis.sentence
    (gap,) = diagnosis.gap.values()
    assert gap.after < 0.05 * gap.before, diagnosis.sentence
