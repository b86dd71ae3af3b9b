"""A trained policy as an ONNX file, which runs without PyTorch and without pma-gym."""

# %%
from pathlib import Path

import numpy as np
import onnx
from onnx.reference import ReferenceEvaluator

from benchmarks.training.onnx_file import write_onnx
from controllers.policies.policy_file import load_policy_file
from controllers.policy import POLICIES

policy = load_policy_file(POLICIES / "displacement-100hz-ppo.json")
write_onnx(policy, Path("policy.onnx"))

# %%
model = onnx.load("policy.onnx")
entries = model.graph.input[0].type.tensor_type.shape.dim[1].dim_value
observations = np.random.default_rng(1).normal(size=(3, entries)).astype(np.float32)
(actions,) = ReferenceEvaluator(model).run(None, {"observation": observations})
print(f"{entries} entries of an observation to an action: {actions.ravel().round(3)}")
assert actions.shape == (3, 1) and np.isfinite(actions).all()
