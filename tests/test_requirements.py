"""What pyproject.toml says of versions is true, as far as it can be seen without installing any."""

import pytest

from tests.lower_bounds import is_version, requirements


@pytest.mark.parametrize("extra, name, bound", requirements(tools=True))
def test_every_requirement_has_a_lower_bound(extra, name, bound):
    assert bound, f"{name} of {extra or 'the core'}: add >= and a version"


def test_a_package_has_one_lower_bound():
    """Extras are installed together, and each bound is tested."""
    bounds = {}
    for _, name, bound in requirements(tools=True):
        assert bounds.setdefault(name, bound) == bound


@pytest.mark.parametrize(
    "installed, bound, same",
    [
        ("2.4.0+cpu", "2.4", True),
        ("2.4.0", "2.4.0", True),
        ("2.4.1", "2.4", False),
        ("2.40", "2.4", False),
        ("0.10.1", "0.10.1", True),
    ],
)
def test_versions_are_compared_by_number(installed, bound, same):
    assert is_version(installed, bound) == same


def test_the_versions_that_fail_are_excluded():
    """Seen in the field: gymnasium 1.0 has no AutoresetMode, OSQP 0.6 no algebra."""
    bounds = {name: bound for _, name, bound in requirements()}
    assert tuple(map(int, bounds["gymnasium"].split("."))) >= (1, 1)
    assert tuple(map(int, bounds["osqp"].split("."))) >= (1, 0)
    assert tuple(map(int, bounds["typer"].split("."))) > (0, 12, 5)
