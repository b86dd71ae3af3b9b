"""Finding the missing physics: one module a step."""

from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.workflow import diagnose, refit

__all__ = ["Diagnosis", "diagnose", "refit"]
