"""Tianshou: PPO by a registered id, through its high-level interface."""

from tianshou.highlevel.config import OnPolicyTrainingConfig
from tianshou.highlevel.env import EnvFactoryRegistered, VectorEnvType
from tianshou.highlevel.experiment import ExperimentConfig, PPOExperimentBuilder

ID = "pma_gym:pma_gym/IsokineticDisplacement-v0"
STEPS = 1024


def train(kind: VectorEnvType) -> None:
    """Train for an epoch with one kind of Tianshou's vectors of environments."""
    options = {"pressure_kpa": 300.0, "control_rate_hz": 20.0}
    envs = EnvFactoryRegistered(task=ID, venv_type=kind, **options)
    training = OnPolicyTrainingConfig(
        max_epochs=1,
        epoch_num_steps=STEPS,
        num_training_envs=2,
        num_test_envs=2,
        buffer_size=1024,
        collection_step_num_env_steps=256,
        batch_size=64,
    )
    place = ExperimentConfig(persistence_enabled=False, watch=False)
    result = PPOExperimentBuilder(envs, place, training).build().run().trainer_result
    assert result is not None and result.best_reward < 0.0


if __name__ == "__main__":
    for kind in (VectorEnvType.DUMMY, VectorEnvType.SUBPROC):
        train(kind)
    print(f"PPO {STEPS} steps with DummyVectorEnv and SubprocVectorEnv")
