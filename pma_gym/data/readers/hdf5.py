"""HDF5 files, MATLAB's version 7.3 among them: datasets of numbers, in groups."""

import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from pma_gym.data.readers.libraries import needed
from pma_gym.data.readers.table import Request, Table, UnreadableError
from pma_gym.data.readers.variables import Variable, tables_of
from pma_gym.data.trial_columns import TrialError
from pma_gym.limits import LimitError, check_limit

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_FILTERS = {1, 2, 3, 5, 6}
"""Deflate, shuffle, checksum, n-bit, scale-offset: what HDF5 unpacks without a plug-in."""
_HIDDEN = "#"
"""Begins the names of groups in which MATLAB keeps what others refer to."""
_OPAQUE = "MATLAB_object_decode"


def read_hdf5(content: bytes, file: str, request: Request = Request()) -> list[Table]:  # noqa: B008
    """The tables in an HDF5 file: vectors of one length in a group.

    Links to other files and plug-ins for unpacking are not followed.

    Args:
        content: bytes of the file.
        file: its name, for messages.
        request: known names.
    Returns:
        Tables, one a group that holds any.
    Raises:
        TrialError: h5py is missing or cannot read it, or it is beyond a limit.
    """
    h5py = needed("h5py", file)
    try:
        with h5py.File(io.BytesIO(content), "r") as source:
            variables = dict(_members(h5py, source, file, 0, set()))
    except (TrialError, LimitError):
        raise
    # h5py raises OSError, RuntimeError, KeyError, TypeError... for damaged files.
    except Exception as error:
        said = str(error).partition("\n")[0][:200]
        raise UnreadableError(f"{file} is not a readable HDF5 file: {said}") from None
    return tables_of(variables, file, request)


def _members(
    h5py: Any,  # noqa: ANN401
    group: Any,  # noqa: ANN401
    file: str,
    depth: int,
    seen: set[int],
) -> Iterator[tuple[str, Variable]]:
    """Names and values of what a group holds itself, each thing once: links may go in circles."""
    check_limit(file, "nesting", depth)
    check_limit(file, "columns", len(group))
    for name in group:
        # A soft or external link may lead out of the file, or round in a circle.
        if name.startswith(_HIDDEN) or not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        member = group[name]
        address = h5py.h5o.get_info(member.id).addr
        if address in seen:
            continue
        seen.add(address)
        check_limit(file, "columns", len(seen))
        if isinstance(member, h5py.Group):
            opaque = _OPAQUE in member.attrs
            yield (
                name,
                "opaque" if opaque else [dict(_members(h5py, member, file, depth + 1, seen))],
            )
        elif isinstance(member, h5py.Dataset):
            yield name, "opaque" if _OPAQUE in member.attrs else _numbers(member, file)


def _numbers(dataset: Any, file: str) -> np.ndarray | None:  # noqa: ANN401
    """Numbers of a dataset; None if it holds anything else."""
    if (
        dataset.dtype.kind not in "fiu"
        or not dataset.shape
        or dataset.attrs.get("MATLAB_class", b"double") in (b"char", b"cell")
    ):
        return None
    size = 1
    for length in dataset.shape:
        size *= int(length)
    check_limit(file, "cells", size)
    chunk = int(np.prod([float(n) for n in dataset.chunks or (0,)])) * dataset.dtype.itemsize
    check_limit(file, "table_mib", chunk / 2**20)
    creation = dataset.id.get_create_plist()
    filters = {creation.get_filter(i)[0] for i in range(creation.get_nfilters())}
    if not filters <= _FILTERS or dataset.external or dataset.is_virtual:
        return None
    # MATLAB keeps columns one after the other, HDF5 rows.
    return np.asarray(dataset[()], dtype=np.float64).T
