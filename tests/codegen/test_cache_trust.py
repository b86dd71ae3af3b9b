"""Compiled code that somebody else may have written is never run."""

import ctypes
import hashlib
import hmac
import os
import stat
import subprocess
import sys
import warnings

import pytest

from pma_gym.codegen.cache import compile_cache, trust
from pma_gym.codegen.machine import native
from pma_gym.codegen.machine.native import Library, object_code

TEXT = "define double @value(double %x) {{ ret double {value} }}"
OTHER_USER = 12345

posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes are POSIX")
as_root = pytest.mark.skipif(
    os.name != "posix" or os.geteuid() != 0, reason="only root gives files to other users"
)


@pytest.fixture
def root(tmp_path, monkeypatch):
    """Folder of the cache, not opened yet in this process."""
    monkeypatch.setenv("PMA_GYM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(native, "_libraries", {})
    return tmp_path / "cache"


def reopen():
    """What the next process does first."""
    compile_cache._opened.cache_clear()
    compile_cache._said.clear()
    native._libraries.clear()


def value(expected_kept):
    """Run the function that the cache has, or compile it."""
    library = Library(TEXT.format(value=1.0))
    assert library.was_kept == expected_kept
    return library.function("value", [ctypes.c_double], ctypes.c_double)(0.0)


def anew(expected_kept):
    """What the function of the cache gives the next process."""
    reopen()
    return value(expected_kept)


def planted_code():
    """Valid machine code of the same function, that does something else."""
    return object_code(TEXT.format(value=666.0))


@pytest.fixture
def entry(root):
    """The one entry of a cache that works."""
    assert value(False) == 1.0
    assert anew(True) == 1.0
    reopen()
    (path,) = (root / "kernels").glob("*.o")
    return path


def unsigned(name, code):
    """The form of earlier versions: a hash that anybody can compute."""
    return b"pma_gym kernels 1\n" + hashlib.sha256(code).digest() + code


def of_another_key(name, code):
    return compile_cache._MAGIC + trust.signature(b"k" * 32, name, code) + code


def hash_for_signature(name, code):
    return compile_cache._MAGIC + hashlib.sha256(code).digest() + code


def of_another_name(name, code):
    key = trust.user_key(compile_cache._store().folder)
    return compile_cache._MAGIC + trust.signature(key, "0" * 64, code) + code


def without_a_name(name, code):
    key = trust.user_key(compile_cache._store().folder)
    return compile_cache._MAGIC + hmac.digest(key, code, "sha256") + code


@pytest.mark.parametrize(
    "form", [unsigned, of_another_key, hash_for_signature, of_another_name, without_a_name]
)
def test_a_planted_entry_is_not_run(entry, form):
    whole = entry.read_bytes()
    entry.write_bytes(form(entry.stem, planted_code()))
    assert anew(False) == 1.0
    assert entry.read_bytes() == whole


def test_the_planted_code_would_run_with_the_key_of_this_user(entry):
    """The tests above can fail: only the signature is what they lack."""
    key, code = trust.user_key(entry.parent), planted_code()
    entry.write_bytes(compile_cache._MAGIC + trust.signature(key, entry.stem, code) + code)
    assert value(True) == 666.0


@posix
def test_what_is_kept_is_private_under_any_umask(root):
    before = os.umask(0)
    try:
        value(False)
    finally:
        os.umask(before)
    modes = {p.name: stat.S_IMODE(p.stat().st_mode) for p in (root / "kernels").iterdir()}
    assert len(modes) == 2 and set(modes.values()) == {0o600}
    assert [stat.S_IMODE(p.stat().st_mode) for p in (root, root / "kernels")] == [0o700] * 2
    assert anew(True) == 1.0


@posix
@pytest.mark.parametrize("mode", [0o770, 0o702])
@pytest.mark.parametrize("which", ["cache", "kernels"])
def test_a_folder_that_others_may_write_is_not_used(entry, which, mode):
    folder = entry.parent if which == "kernels" else entry.parent.parent
    folder.chmod(mode)
    content = entry.read_bytes()
    reopen()
    with pytest.warns(UserWarning, match=rf"may write to .*{which} \(mode 0?{mode:o}\).*PMA_GYM_"):
        assert value(False) == 1.0
    with warnings.catch_warnings():
        # Said once; the next library is kept in this process' own folder.
        warnings.simplefilter("error")
        assert value(True) == 1.0
    assert compile_cache._store().folder.parent != entry.parent.parent
    assert entry.read_bytes() == content
    folder.chmod(0o700)
    assert anew(True) == 1.0


@as_root
@pytest.mark.parametrize("which", ["cache", "kernels", "entry", "key"])
def test_what_belongs_to_another_user_is_not_used(entry, which):
    key, folders = entry.parent / trust.KEY_FILE, (entry.parent, entry.parent.parent)
    own = {"cache": folders[1], "kernels": folders[0], "entry": entry, "key": key}[which]
    os.chown(own, OTHER_USER, OTHER_USER)
    reopen()
    with pytest.warns(UserWarning, match=f"belongs to another user .uid {OTHER_USER}"):
        assert value(False) == 1.0
    if which in ("entry", "key"):
        reopen()
        assert own.stat().st_uid == os.geteuid() and value(True) == 1.0


@posix
def test_an_entry_that_others_may_write_is_not_run(entry):
    entry.chmod(0o666)
    with pytest.warns(UserWarning, match="other users may write.* it is not run, but compiled"):
        assert value(False) == 1.0
    assert anew(True) == 1.0


@posix
@pytest.mark.parametrize("kind", ["link", "pipe", "folder"])
def test_an_entry_that_is_no_file_is_not_run(entry, tmp_path, kind):
    content = entry.read_bytes()
    entry.unlink()
    if kind == "link":
        (tmp_path / "elsewhere").write_bytes(content)
        entry.symlink_to(tmp_path / "elsewhere")
    elif kind == "pipe":
        os.mkfifo(entry)
    else:
        entry.mkdir()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert value(False) == 1.0


@posix
@pytest.mark.parametrize("fault", ["readable", "link", "short", "empty"])
def test_a_key_that_is_not_secret_is_made_anew(entry, tmp_path, fault):
    key = entry.parent / trust.KEY_FILE
    old = key.read_bytes()
    if fault == "readable":
        key.chmod(0o644)
    elif fault == "link":
        key.rename(tmp_path / "kept")
        key.symlink_to(tmp_path / "kept")
    else:
        key.write_bytes(old[:5] if fault == "short" else b"")
    reopen()
    with pytest.warns(UserWarning, match="the key of the compiled code is not used"):
        assert value(False) == 1.0
    assert key.read_bytes() != old and len(key.read_bytes()) == len(old)
    assert stat.S_IMODE(key.lstat().st_mode) == 0o600
    assert anew(True) == 1.0


@posix
def test_the_folder_may_be_a_link_of_this_user_but_not_the_one_inside(entry, tmp_path):
    folder = entry.parent.parent
    folder.rename(tmp_path / "disk")
    folder.symlink_to(tmp_path / "disk")
    assert anew(True) == 1.0
    (tmp_path / "disk" / "kernels").rename(tmp_path / "moved")
    (tmp_path / "disk" / "kernels").symlink_to(tmp_path / "moved")
    reopen()
    with pytest.warns(UserWarning, match="is a link; remove it"):
        assert value(False) == 1.0


@as_root
def test_a_link_of_another_user_is_not_followed(entry, tmp_path):
    folder = entry.parent.parent
    folder.rename(tmp_path / "disk")
    folder.symlink_to(tmp_path / "disk")
    os.chown(folder, OTHER_USER, OTHER_USER, follow_symlinks=False)
    reopen()
    with pytest.warns(UserWarning, match="belongs to another user"):
        assert value(False) == 1.0


def test_a_cache_that_was_emptied_meanwhile_is_made_again(entry):
    value(True)
    for path in entry.parent.iterdir():
        path.unlink()
    entry.parent.rmdir()
    assert value(False) == 1.0
    assert anew(True) == 1.0


@pytest.mark.campaign
def test_processes_that_make_the_key_at_once_end_with_one(tmp_path):
    code = (
        "import sys, pathlib\n"
        "from pma_gym.codegen.cache.trust import user_key\n"
        "print('ready', flush=True)\n"
        "for folder in sys.stdin:\n"
        "    print(user_key(pathlib.Path(folder.strip())).hex(), flush=True)"
    )
    made = [
        subprocess.Popen(
            [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    for process in made:
        assert process.stdout.readline() == "ready\n"
    for round_ in range(3):
        folder = tmp_path / str(round_)
        folder.mkdir(mode=0o700)
        for process in made:
            process.stdin.write(f"{folder}\n")
            process.stdin.flush()
        keys = {process.stdout.readline().strip() for process in made}
        assert keys == {(folder / trust.KEY_FILE).read_bytes().hex()}
        assert [path.name for path in folder.iterdir()] == [trust.KEY_FILE]
    for process in made:
        process.communicate()


def test_without_hard_links_the_key_is_made_too(tmp_path, monkeypatch):
    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    assert trust.user_key(tmp_path) == trust.user_key(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [trust.KEY_FILE]


def test_a_system_without_owners_works(root, monkeypatch):
    monkeypatch.delattr(os, "geteuid", raising=False)
    monkeypatch.delattr(os, "getuid", raising=False)
    monkeypatch.setattr("pma_gym.codegen.cache.trust._HAS_OWNERS", False)
    assert value(False) == 1.0
    assert anew(True) == 1.0
