"""Compiled libraries: calls, and what is kept on disk and found again.

Arrays are read by compiled code only where they are laid out as it believes.
"""

import ast
import ctypes
import gc
from pathlib import Path

import pytest

import pma_gym
from pma_gym.codegen.cache import compile_cache
from pma_gym.codegen.machine import control, native
from pma_gym.codegen.machine.native import Library, compiled

TEXT = "define double @{name}(double %x) {{ %y = fmul double %x, {factor}\nret double %y }}"


def text(name="scaled", factor=2.0):
    return TEXT.format(name=name, factor=factor)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("PMA_GYM_CACHE", str(tmp_path))
    monkeypatch.setattr(native, "_libraries", {})
    return tmp_path / "kernels"


def scaled(library):
    return library.function("scaled", [ctypes.c_double], ctypes.c_double)


def test_what_is_kept_is_not_built_again(folder, monkeypatch):
    built = []

    def build():
        built.append(1)
        return text()

    first = compiled(["model", "a"], build)
    assert compiled(["model", "a"], build) is first
    monkeypatch.setattr(native, "_libraries", {})
    second = compiled(["model", "a"], build)
    assert second is not first and second.was_kept
    assert scaled(second)(2.0) == 4.0
    assert built == [1]
    compiled(["model", "b"], build)
    # Where one part ends matters.
    compiled(["mode", "lb"], build)
    assert built == [1] * 3


@pytest.mark.parametrize("collects", [True, False])
def test_garbage_is_collected_after_compiling_as_before(folder, collects):
    seen = []

    def build():
        seen.append(gc.isenabled())
        return text(factor=float(len(seen)))

    def broken():
        raise ValueError

    (gc.enable if collects else gc.disable)()
    try:
        compiled(["collects", str(collects)], build)
        assert seen == [False] and gc.isenabled() == collects
        with pytest.raises(ValueError):
            compiled(["broken", str(collects)], broken)
        assert gc.isenabled() == collects
    finally:
        gc.enable()


@pytest.mark.parametrize("damage", ["truncated", "empty", "one bit", "other"])
def test_a_damaged_file_is_compiled_anew(folder, damage):
    Library(text())
    (path,) = folder.glob("*.o")
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[-100] ^= 1
    path.write_bytes(
        {"truncated": whole[:-50], "empty": b"", "one bit": flipped, "other": b"x" * 500}[damage]
    )
    library = Library(text())
    assert not library.was_kept
    assert scaled(library)(3.0) == 6.0
    assert path.read_bytes() == whole


def test_a_full_disk_costs_only_the_keeping(folder, monkeypatch):
    def refuse(*_, **__):
        raise OSError("no space left")

    monkeypatch.setattr(compile_cache, "replace_file", refuse)
    assert scaled(Library(text(factor=5.0)))(2.0) == 10.0
    assert not list(folder.glob("*.o"))


def test_another_processor_or_an_edit_makes_another_key(folder, monkeypatch):
    compiled(["m"], text)
    for name, value in (("host", lambda: ("generic", "")), ("source_digest", lambda: "edited")):
        monkeypatch.setattr(native, "_libraries", {})
        with monkeypatch.context() as patch:
            patch.setattr(native, name, value)
            assert not compiled(["m"], text).was_kept
    monkeypatch.setattr(native, "_libraries", {})
    assert compiled(["m"], text).was_kept


def test_the_key_covers_every_text_that_code_is_written_by(tmp_path, monkeypatch):
    for name in ("effects", "codegen/cache", "plant"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "law.py").write_text("x = 1\n")
    monkeypatch.setattr(
        compile_cache, "__file__", str(tmp_path / "codegen" / "cache" / "compile_cache.py")
    )
    digests = [compile_cache.source_digest.__wrapped__()]
    for name in ("effects", "codegen/cache", "plant"):
        (tmp_path / name / "law.py").write_text("x = 2\n")
        digests.append(compile_cache.source_digest.__wrapped__())
    (tmp_path / "effects" / "new.py").write_text("")
    digests.append(compile_cache.source_digest.__wrapped__())
    assert len(set(digests)) == 5
    for name in compile_cache.WRITES_NO_CODE:
        (tmp_path / f"{name}.py").write_text("x = 1\n")
    assert compile_cache.source_digest.__wrapped__() == digests[-1]


def imported_names(path):
    """Modules that a file imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_what_the_key_leaves_out_writes_no_code_and_lies_above_all_that_does():
    package = Path(pma_gym.__file__).parent
    above = tuple(f"pma_gym.{name}." for name in compile_cache.WRITES_NO_CODE)
    rooms = {path.relative_to(package).with_suffix("").parts[0] for path in package.rglob("*.py")}
    assert set(compile_cache.WRITES_NO_CODE) < rooms
    for path in package.rglob("*.py"):
        room = path.relative_to(package).with_suffix("").parts[0]
        writes = room not in compile_cache.WRITES_NO_CODE
        if room == "__init__":
            continue
        refused = above if writes else ("pma_gym.codegen.machine", "llvmlite")
        assert not [name for name in imported_names(path) if name.startswith(refused)], path


def test_mistakes_are_named(folder):
    with pytest.raises(KeyError, match="no function other in library small"):
        Library(text(), "small").function("other", [])
    with pytest.raises(RuntimeError, match="expected"):
        Library("define nonsense")
    assert len(list(folder.glob("*.o"))) == 1


@pytest.fixture
def looked_at_anew():
    control.are_known.cache_clear()
    yield
    control.are_known.cache_clear()


def test_this_numpy_is_known():
    assert control.are_known()


@pytest.mark.parametrize(
    ("member", "other"),
    [
        ("DIMENSIONS", "SIZES"),
        ("SIZES", "STRIDES"),
        ("STRIDES", "SIZES"),
        ("DATA", "STRIDES"),
        ("DTYPE", "DATA"),
        ("TYPE", "DTYPE"),
    ],
)
def test_a_member_that_lies_elsewhere_is_noticed(monkeypatch, looked_at_anew, member, other):
    monkeypatch.setattr(control, member, getattr(control, other))
    assert not control.are_known()
