"""HDF5 files, MATLAB's version 7.3 among them: datasets of numbers, in groups."""

import io
import math
import pickletools
from typing import Any

import numpy as np

from pma_gym.data.files.trial_formats import needed
from pma_gym.data.readers.table import Request, Table
from pma_gym.data.readers.variables import (
    NUMBERS,
    OPAQUE,
    Unread,
    Variable,
    array_of,
    tables_of,
    unread,
)
from pma_gym.limits import check_limit, limit

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_FILTERS = {1, 2, 3, 5, 6}
"""Deflate, shuffle, checksum, n-bit, scale-offset: what HDF5 unpacks without a plug-in."""
_HIDDEN = ("#", "_i_")
"""Begin names of groups in which MATLAB keeps what others refer to, PyTables its indices."""


def read(content: bytes, file: str, request: Request) -> list[Table]:
    """The tables in an HDF5 file: vectors of one length in a group, fields of a compound dataset.

    Links to other files and plug-ins for unpacking are not followed.

    Args:
        content: bytes of the file.
        file: its name, for messages.
        request: known names.
    Returns:
        Tables, one a group, structure or compound dataset that holds any.
    Raises:
        TrialError: h5py is missing, or no table.
        LimitError: beyond a limit.
    """
    h5py = needed("h5py", file)
    with h5py.File(io.BytesIO(content), "r") as source:
        return tables_of(_Members(h5py, source, file).of(source, 0), file, request)


class _Members:
    """Takes values from groups, each address once: links may go in circles."""

    def __init__(self, h5py: Any, source: Any, file: str) -> None:  # noqa: ANN401
        self._h5py, self._source, self._file = h5py, source, file
        self._seen: set[int] = set()
        self._values = self._cells = 0

    def of(self, group: Any, depth: int) -> dict[str, Variable]:  # noqa: ANN401
        """Names and values of what a group holds itself."""
        check_limit(self._file, "columns", len(group))
        out: dict[str, Variable] = {}
        for key in group:
            # h5py leaves a name as bytes that is no UTF-8.
            name = key if isinstance(key, str) else key.decode("utf-8", "replace")
            # A soft or external link may lead out of the file, or round in a circle.
            hard = isinstance(group.get(key, getlink=True), self._h5py.HardLink)
            if name.startswith(_HIDDEN) or not hard:
                continue
            address = self._h5py.h5o.get_info(group[key].id).addr
            if address not in self._seen:
                self._seen.add(address)
                out |= _field(name, self._value(group[key], depth), _frame_names(group, name))
        return out

    def _value(self, member: Any, depth: int) -> Variable:  # noqa: ANN401
        check_limit(self._file, "nesting", depth)
        self._values += 1
        check_limit(self._file, "values", self._values)
        if "MATLAB_object_decode" in member.attrs:
            return OPAQUE
        if "MATLAB_sparse" in member.attrs:
            return Unread("a sparse matrix")
        if isinstance(member, self._h5py.Group):
            return self._structures(member, depth)
        if not isinstance(member, self._h5py.Dataset) or "MATLAB_empty" in member.attrs:
            return None
        return self._dataset(member)

    def _structures(self, group: Any, depth: int) -> Variable:  # noqa: ANN401
        """A group as one structure; MATLAB's arrays of structures hold a reference an element."""
        fields = {str(key): group[key] for key in group if _refers(self._h5py, group, key)}
        if not fields:
            return [self.of(group, depth + 1)]
        size = max(field.size for field in fields.values())
        check_limit(self._file, "sheets", size)
        links = {name: field[()].ravel() for name, field in fields.items()}
        return [
            {
                name: self._value(self._source[refs[index]], depth + 1)
                for name, refs in links.items()
                if index < len(refs) and refs[index]
            }
            for index in range(size)
        ]

    def _dataset(self, dataset: Any) -> Variable:  # noqa: ANN401
        """Numbers of a dataset, or its fields; why not, if it holds anything else."""
        if not dataset.shape:
            return None
        try:
            dtype = dataset.dtype
        except TypeError:
            return Unread("values of a type that NumPy lacks")
        kind = dataset.attrs.get("MATLAB_class", b"")
        if kind == b"char" or kind == b"cell":
            return Unread("a cell array") if kind == b"cell" else None
        if dtype.names == ("real", "imag"):
            return Unread("complex numbers")
        creation = dataset.id.get_create_plist()
        filters = {creation.get_filter(i)[0] for i in range(creation.get_nfilters())}
        if not filters <= _FILTERS or dataset.external or dataset.is_virtual:
            return Unread("packed by a plug-in, or in another file")
        fields = [dtype[name] for name in dtype.names or ()]
        widths = [math.prod(field.shape) for field in fields]
        self._cells += math.prod(dataset.shape) * (sum(widths) or 1)
        check_limit(self._file, "cells", self._cells)
        chunk = math.prod(dataset.chunks or (0,)) * dtype.itemsize
        check_limit(self._file, "table_mib", chunk / 2**20)
        if not fields and dtype.kind not in NUMBERS:
            return unread(dtype) if dataset.size > 1 else None
        values = dataset[()]
        if not fields:
            # MATLAB keeps columns one after the other, HDF5 rows.
            return array_of(values.T if kind else values)
        out: dict[str, Variable] = {}
        for name in dtype.names:
            names = _field_names(dataset.attrs.get(f"{name}_kind"))
            out |= _field(name, array_of(values[name]), names)
        return [out]


def _refers(h5py: Any, group: Any, name: str) -> bool:  # noqa: ANN401
    """Whether a field of a structure refers to one value for each structure of an array."""
    member: Any = group.get(name)
    return (
        group.attrs.get("MATLAB_class") == b"struct"
        and isinstance(member, h5py.Dataset)
        and member.dtype == h5py.ref_dtype
        and "MATLAB_class" not in member.attrs
    )


def _field(name: str, values: Variable, names: list[str]) -> dict[str, Variable]:
    """The columns of a field by their names: pandas keeps columns of one type in one field."""
    if isinstance(values, np.ndarray) and values.ndim == 2 and len(names) == values.shape[1]:
        return {each: values[:, i] for i, each in enumerate(names)}
    return {name: values}


def _frame_names(group: Any, name: str) -> list[str]:  # noqa: ANN401
    """Names that pandas keeps beside a block of a frame of fixed format."""
    if group.attrs.get("pandas_type") != b"frame" or not name.endswith("_values"):
        return []
    items: Any = group.get(f"{name.removesuffix('_values')}_items")
    if items is None or items.dtype.kind != "S" or items.size > limit("columns"):
        return []
    return [each.decode() for each in items[()].tolist()]


def _field_names(pickled: object) -> list[str]:
    """Names of columns that pandas pickled beside a field; the pickle is never loaded."""
    if not isinstance(pickled, bytes | str):
        return []
    content = pickled if isinstance(pickled, bytes) else pickled.encode()
    try:
        return [each for _, each, _ in pickletools.genops(content) if isinstance(each, str)]
    except ValueError:
        return []
