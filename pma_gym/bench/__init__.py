"""Real rigs: a serial line to firmware, a loop with limits, a log that `diagnose` reads.

`Emulator` is firmware of a simulated plant on a pseudo terminal. No controller is imported here.
"""

from pma_gym.bench.control_loop import ControlLoop, Step
from pma_gym.bench.rig import Rig, RigError, Sample
from pma_gym.bench.rig_file import RigFile, read_rig_file
from pma_gym.bench.serial_rig import SerialRig, open_rig
from pma_gym.bench.trial_log import TrialLog

__all__ = [
    "ControlLoop",
    "Rig",
    "RigError",
    "RigFile",
    "Sample",
    "SerialRig",
    "Step",
    "TrialLog",
    "open_rig",
    "read_rig_file",
]
