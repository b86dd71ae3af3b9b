"""The policies that ship."""

from controllers.policies.policy_file import load_policy_file
from controllers.policy import shipped_policies
from generators.text import code, table


def policies_shipped() -> str:
    """The policies that ship."""
    rows = []
    for path in shipped_policies():
        policy = load_policy_file(path)
        training = policy.training
        validation = training["scores"]["validation"]
        size = sum(p.stat().st_size for p in (path, path.with_suffix(".safetensors"))) / 1024
        rows.append(
            [
                code(policy.name),
                training["preset"],
                f"{training['seed']}",
                f"{training['steps'] / 1e6:.2g}",
                f"{validation['error']:.3g} {validation['unit']}",
                f"{size:.0f}",
            ]
        )
    header = ["Policy", "Preset", "Seed", "Steps (10^6)", "Validation", "KiB"]
    return table(header, rows, (2, 3, 4, 5))
