"""`python -m pma_gym.cli` is `pma-gym`."""

from pma_gym.cli import main

main()
