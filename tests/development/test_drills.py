"""The pages that say how to add something work as they stand, and touch three or four files."""

import pytest

from tests.development.drill import copied, follow, run_pytest


@pytest.mark.campaign
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


@pytest.mark.campaign
def test_an_effect_is_three_files(tmp_path):
    copy = copied(
        tmp_path, "pma_gym", "pyproject.toml", "tests/effects/conftest.py",
        "tests/effects/test_catalogue.py",
    )  # fmt: skip
    assert len(set(follow("add-an-effect.md", copy))) == 3
    done = run_pytest(copy, "tests/effects", "-k", "guide_lubricant or lubricant_force")
    assert done.returncode == 0, done.stdout + done.stderr
    # The page's own test, and more than as many contracts of the catalogue.
    assert int(done.stdout.split(" passed")[0].split()[-1]) >= 8


def test_a_task_is_three_files(tmp_path):
    copy = copied(tmp_path, "pma_gym", "pyproject.toml", "tests/test_tasks.py")
    assert len(set(follow("add-a-task.md", copy))) == 3
    done = run_pytest(copy, "tests/test_tasks.py", "tests/tasks", "-k", "smooth_step")
    assert done.returncode == 0, done.stdout + done.stderr
    # The page's own test, and those that loop over every task.
    assert int(done.stdout.split(" passed")[0].split()[-1]) >= 4


@pytest.mark.campaign
def test_a_rig_is_three_files(tmp_path):
    copy = copied(tmp_path, "pma_gym", "pyproject.toml")
    assert len(set(follow("add-a-rig.md", copy))) == 3
    done = run_pytest(copy, "tests/plant/test_vertical_slide.py")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 passed" in done.stdout


@pytest.mark.campaign
def test_a_sensor_is_four_files(tmp_path):
    copy = copied(
        tmp_path, "pma_gym", "pyproject.toml", "tests/effects/conftest.py",
        "tests/effects/test_catalogue.py",
    )  # fmt: skip
    assert len(set(follow("add-a-sensor.md", copy))) == 4
    done = run_pytest(copy, "tests/plant", "tests/effects", "-k", "torque_flange")
    assert done.returncode == 0, done.stdout + done.stderr
    # The page's own two tests, and contracts of the catalogue.
    assert int(done.stdout.split(" passed")[0].split()[-1]) >= 6
