"""MATLAB's MAT files: SciPy reads up to version 7, 7.3 is HDF5."""

import io

import numpy as np

from pma_gym.data.files.trial_formats import needed
from pma_gym.data.readers import hdf5
from pma_gym.data.readers.table import Request, Table
from pma_gym.data.readers.variables import OPAQUE, Unread, Variable, array_of, tables_of
from pma_gym.limits import check_limit


def read(content: bytes, file: str, request: Request) -> list[Table]:
    """The tables in a MAT file: vectors of one length, or the fields of its structures.

    Args:
        content: bytes of the file.
        file: its name, for messages.
        request: known names.
    Returns:
        Tables, one a structure that holds any.
    Raises:
        TrialError: a MATLAB table.
        LimitError: beyond a limit.
    """
    if hdf5.SIGNATURE in content[:1024]:
        return hdf5.read(content, file, request)
    contents = needed("scipy.io", file).loadmat(io.BytesIO(content))
    variables = {
        _name(name, value): _variable(value, file, 0)
        for name, value in contents.items()
        if name[:2] != "__"
    }
    check_limit(file, "cells", sum(v.size for v in variables.values() if isinstance(v, np.ndarray)))
    return tables_of(variables, file, request)


def _name(name: str, value: object) -> str:
    """A variable's name, which SciPy keeps inside of what it cannot read."""
    return value["s0"].item().decode() if type(value).__name__ == "MatlabOpaque" else name  # type: ignore[index]


def _variable(value: object, file: str, depth: int) -> Variable:
    """A value of SciPy's as numbers, as structures, or as the reason why it is neither."""
    check_limit(file, "nesting", depth)
    if type(value).__name__ == "MatlabOpaque":
        return OPAQUE
    if not isinstance(value, np.ndarray):
        return Unread("a sparse matrix")
    if type(value).__name__ == "MatlabFunction" or value.dtype.names is None:
        return Unread("a cell array") if value.dtype.kind == "O" else array_of(value)
    check_limit(file, "sheets", value.size)
    return [
        {name: _variable(element[name], file, depth + 1) for name in value.dtype.names}
        for element in value.ravel(order="F")
    ]
