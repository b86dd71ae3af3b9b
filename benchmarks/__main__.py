"""`python -m benchmarks`: the main job, and the other jobs as subcommands."""

import os
import sys

# In the order in which --help lists the commands.
# isort: off
from benchmarks.commands import runs, dissertation, settings, hidden_effects  # noqa: F401
from benchmarks.commands import training, exercise, rig  # noqa: F401

# isort: on
from benchmarks.commands.options import app
from pma_gym.terminal import safe_streams

# Figures are drawn to files; each process computes on its own core.
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("OMP_NUM_THREADS", "1")


def main() -> None:
    """The whole command; a file that cannot be written ends it with one message."""
    with safe_streams():
        try:
            app(prog_name="python -m benchmarks")
        except (OSError, ValueError) as error:
            print(f"error: {error}", file=sys.stderr)
            sys.exit(2)


if __name__ == "__main__":
    main()
