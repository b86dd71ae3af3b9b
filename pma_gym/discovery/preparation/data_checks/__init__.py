"""Checks of a data set against the given model, before minutes of fitting."""

from pma_gym.discovery.preparation.data_checks.checking import check_dataset

__all__ = ["check_dataset"]
