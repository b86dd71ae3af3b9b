"""`python -m benchmarks`: the main job, and the other jobs as subcommands."""

import os
import sys

from benchmarks.commands import dissertation, exercise, hidden_effects, runs, settings, training
from pma_gym.cli.options import StrictTyper
from pma_gym.terminal import safe_streams

# Figures are drawn to files; each process computes on its own core.
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("OMP_NUM_THREADS", "1")

app = StrictTyper(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    invoke_without_command=True,
)
# In the order in which --help lists the commands.
runs.register(app)
dissertation.register(app)
settings.register(app)
hidden_effects.register(app)
training.register(app)
exercise.register(app)


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
