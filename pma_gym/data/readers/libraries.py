"""Libraries of the `files` extra, which only some formats need."""

import importlib
from types import ModuleType

from pma_gym.data.readers.table import UnreadableError

_PACKAGES = {"nptdms": "npTDMS"}


def needed(module: str, file: str) -> ModuleType:
    """A library of the `files` extra.

    Raises:
        UnreadableError: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        name = module.partition(".")[0]
        raise UnreadableError(
            f"{_PACKAGES.get(name, name)}, which {file} needs, is not installed: "
            'pip install "pma-gym[files]"'
        ) from None
