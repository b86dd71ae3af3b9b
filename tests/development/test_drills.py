"""The pages that say how to add something work as they stand, and touch three files."""

from tests.development.drill import copied, follow, run_pytest


def test_a_controller_is_three_files(tmp_path):
    copy = copied(
        tmp_path, "controllers", "pyproject.toml", "docs/reference/controllers.md",
        "tests/contracts/test_controllers.py",
    )  # fmt: skip
    contract = ("tests/contracts/test_controllers.py", "-k", "proportional")
    before = run_pytest(copy, *contract)
    assert "deselected" in before.stdout and "passed" not in before.stdout
    touched = follow("add-a-controller.md", copy)
    assert touched == [
        "controllers/proportional.py", "controllers/registry.py", "docs/reference/controllers.md",
    ]  # fmt: skip
    after = run_pytest(copy, *contract)
    assert after.returncode == 0, after.stdout + after.stderr
    assert "3 passed" in after.stdout
