"""How late the steps of a rig begin, beside a bare loop in C.

`python -m benchmarks.speed.rig_lateness 600` runs an emulated station at 200 Hz under the PID and
logs it as always. At the same time a C program only waits for the same deadlines by
clock_nanosleep. Both have the load of the machine.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.commands.rig import station_act
from controllers import CONTROLLERS
from pma_gym.bench import ControlLoop, TrialLog, open_rig, read_rig_file
from pma_gym.tasks import TASKS

RATE_HZ = 200

BARE = r"""
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
int main(int count, char **words) {
    long long steps = atol(words[1]), period = atol(words[2]), start, now, k = 0;
    double *late = malloc(steps * sizeof *late);
    long made = 0;
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    start = t.tv_sec * 1000000000LL + t.tv_nsec;
    while (k < steps) {
        long long due = start + k * period;
        t.tv_sec = due / 1000000000LL;
        t.tv_nsec = due % 1000000000LL;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
        clock_gettime(CLOCK_MONOTONIC, &t);
        now = t.tv_sec * 1000000000LL + t.tv_nsec;
        late[made++] = (now - due) * 1e-3;
        // Periods that are over are passed over, as by the rig's loop.
        long long current = (now - start) / period;
        k = current > k ? current : k + 1;
    }
    for (long i = 0; i < made; i++) printf("%.3f\n", late[i]);
}
"""

RIG = f"""
model = "station"
port = "emulator"
rate_hz = {RATE_HZ}
watchdog_ms = 1000
settle_s = 1.0
[commands]
motor_voltage_v = {{range = [0, 10], rate = 50, rest = 0.1}}
regulator_voltage_v = {{range = [0, 8], rate = 20, rest = 0, start = 5}}
[measurements]
contraction_mm = {{range = [-40, 90]}}
rotation_deg = {{range = [-900, 900]}}
load_n = {{range = [-100, 1000]}}
pressure_kpa = {{range = [-50, 700]}}
[safe]
action = "vent"
"""


def quantiles(late_us: list[float], steps: int) -> dict[str, float]:
    """Median, 99.9 % and most of latenesses (us), and how many periods were passed over."""
    values = np.quantile(late_us, [0.5, 0.999, 1.0]).round(1).tolist()
    named = dict(zip(("median_us", "p999_us", "most_us"), values, strict=True))
    return {**named, "passed_over": steps - len(late_us)}


def measure(seconds: float, folder: Path) -> dict[str, object]:
    """Run both loops at once and compare how late their steps begin."""
    source, program, file = folder / "bare.c", folder / "bare", folder / "rig.toml"
    source.write_text(BARE)
    file.write_text(RIG)
    subprocess.run(["cc", "-O2", "-o", program, source], check=True)
    rig, controller = read_rig_file(file), CONTROLLERS["pid"]()
    act = station_act(rig, TASKS["displacement"], controller)
    steps = round(seconds * RATE_HZ)
    command = [program, str(steps), str(round(1e9 / RATE_HZ))]
    with open_rig(rig) as line, TrialLog(folder / "log", rig).trial() as write:
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as bare:
            made = ControlLoop(line, rig).run(seconds, act, write)
            printed, _ = bare.communicate()
    late = {"rig": [step.late_us for step in made], "bare": list(map(float, printed.split()))}
    return {name: quantiles(values, steps) for name, values in late.items()}


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        print(json.dumps(measure(float(sys.argv[1]), Path(name)), indent=1))
