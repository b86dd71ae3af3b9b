"""pma-gym: an open test bench for the control of pneumatic muscles."""

from pma_gym.data.trial import Trial
from pma_gym.data.trial_comparison import TrialComparison, compare
from pma_gym.envs import ENVIRONMENTS, PMAEnv
from pma_gym.files import give_matplotlib_a_folder
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant

__version__ = "0.1.0"
__all__ = [
    "ENVIRONMENTS",
    "Model",
    "PMAEnv",
    "Plant",
    "Trial",
    "TrialComparison",
    "compare",
    "load_model",
]

give_matplotlib_a_folder()
