"""Another name of `pma_gym.kernels.lanes`."""

from pma_gym.kernels.lanes import lanes, rebind

__all__ = ["lanes", "rebind"]
