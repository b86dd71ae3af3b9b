"""Old names of controllers work, with one warning that says the new one."""

import importlib
import sys

import pytest

import controllers
from controllers.registry import RENAMED_MODULES


@pytest.mark.parametrize("old", RENAMED_MODULES)
def test_an_old_module_imports_with_one_warning(old, monkeypatch):
    monkeypatch.delitem(sys.modules, old, raising=False)
    with pytest.warns(DeprecationWarning, match=f"module {old} is now ") as said:
        module = importlib.import_module(old)
    assert len(said) == 1 and module.__all__


def test_old_classes_are_the_new_ones():
    with pytest.warns(DeprecationWarning, match="PractisedPolicy is now PolicyWithILC"):
        assert controllers.PractisedPolicy is controllers.PolicyWithILC
    spec = importlib.import_module("controllers.policies.observation_spec")
    with pytest.warns(DeprecationWarning, match="View is now ObservationSpec"):
        assert spec.View is spec.ObservationSpec
