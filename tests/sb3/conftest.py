"""Models as those of `tests/envs`."""

from tests.envs.conftest import fragile

__all__ = ["fragile"]
