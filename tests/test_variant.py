"""The door to Mitsuba, and the search for an LLVM that does not abort."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from prelight.errors import MissingExtraError
from prelight.scene import llvm, variant
from prelight.scene.llvm import all_llvm, find_llvm, identify, install_line

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="names and headers of Linux libraries")


@pytest.fixture(scope="module")
def head() -> bytes:
    """The first bytes of a library for this processor."""
    with open(sys.executable, "rb") as file:
        return file.read(20)


@pytest.fixture
def library(tmp_path: Path, head: bytes):
    def made(name: str, content: bytes = head) -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        return path

    return made


@LINUX
@pytest.mark.parametrize(
    ("name", "version"),
    [
        ("libLLVM-14.so.1", (14,)),
        ("libLLVM-14.0.6.so.1", (14, 0, 6)),
        ("libLLVM.so.19.1", (19, 1)),
        ("libLLVM-19.so", (19,)),
        ("libLLVM-20.1.8.so", (20, 1, 8)),
        ("llvm-21/lib/libLLVM.so", (21,)),
        ("llvm@19/lib/libLLVM.dylib", (19,)),
        ("Cellar/llvm/22.1.8/lib/libLLVM.dylib", (22, 1, 8)),
        ("libLLVM-19-rust-1.80.so", None),
        ("libLLVMCore.so", None),
        ("libclang.so.19", None),
    ],
)
def test_versions_are_read_from_names(library, name: str, version: tuple | None) -> None:
    found = identify(library(name))
    assert (found and found.numbers) == version


@LINUX
def test_the_newest_usable_library_is_taken(library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folders = [tmp_path / "llvm*" / "lib", tmp_path / "usr"]
    assert find_llvm(chosen="", folders=folders, linker=False) is None
    old = library("usr/libLLVM-16.so.1")
    assert find_llvm(chosen="", folders=folders, linker=False) is None
    library("usr/libLLVM.so.19.1")
    newest = library("llvm-22/lib/libLLVM.so.22.1")
    library("llvm-22/lib/libLLVM-23.so", b"not a library, but long enough")
    library("usr/libLLVM-24.so").unlink()
    (tmp_path / "usr/libLLVM-25.so").symlink_to(tmp_path / "gone")
    found = find_llvm(chosen="", folders=folders, linker=False)
    assert found is not None
    assert (found.numbers, found.version, found.path) == ((22, 1), "22.1", newest)
    listed = all_llvm(folders, linker=False)
    assert [entry.numbers for entry in listed] == [(16,), (19, 1), (22, 1)]
    assert [entry.usable for entry in listed] == [False, True, True]
    chosen = library("mine/libLLVM-20.so")
    assert find_llvm(chosen=str(chosen), folders=folders, linker=False).path == chosen
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(chosen))
    assert find_llvm(folders=folders, linker=False).path == chosen
    for useless in (str(old), str(tmp_path / "absent.so"), str(tmp_path)):
        assert find_llvm(chosen=useless, folders=folders, linker=False).path == newest


@LINUX
def test_a_link_is_the_library_it_leads_to(library, tmp_path: Path) -> None:
    real = library("real/libLLVM-21.1.2.so")
    (tmp_path / "links").mkdir()
    (tmp_path / "links/libLLVM.so").symlink_to(real)
    assert identify(tmp_path / "links/libLLVM.so").numbers == (21, 1, 2)
    assert len(all_llvm([tmp_path / "links", tmp_path / "real"], linker=False)) == 1


@LINUX
@pytest.mark.parametrize("at", [4, 18])
def test_libraries_for_another_processor_are_passed_over(library, head: bytes, at: int) -> None:
    other = bytearray(head)
    other[at] ^= 3
    assert identify(library("libLLVM-19.so")) is not None
    assert identify(library("libLLVM-20.so", bytes(other))) is None


@LINUX
def test_a_library_without_a_version_is_asked_in_a_process_of_its_own(
    library, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = library("plain/libLLVM.so")
    assert identify(path) is None  # what is asked here is not really a library
    monkeypatch.setattr(
        llvm, "_ASK", "import sys; print(19, 1, 7) if sys.argv[1].endswith('.so') else exit(1)"
    )
    assert identify(path).numbers == (19, 1, 7)
    monkeypatch.setattr(llvm, "_ASK", "import os; os.abort()")
    assert identify(path) is None


@pytest.mark.skipif(find_llvm() is None, reason="no LLVM 19 or newer on this machine")
def test_the_library_of_this_machine_says_the_version_of_its_name() -> None:
    found = find_llvm()
    asked = llvm._asked(found.path)
    assert asked[: len(found.numbers)] == found.numbers


@pytest.mark.parametrize(
    ("platform", "release", "line"),
    [
        ("linux", {"ID": "debian"}, "sudo apt-get install -y libllvm19 libgomp1 libatomic1"),
        ("linux", {"ID": "mint", "ID_LIKE": "ubuntu debian"}, "sudo apt-get install -y libllvm19"),
        ("linux", {"ID": "fedora"}, "sudo dnf install -y llvm-libs"),
        ("linux", {"ID": "arch"}, "sudo pacman -S"),
        ("linux", {"ID": "opensuse-leap", "ID_LIKE": "suse opensuse"}, "sudo zypper install -y libLLVM19"),
        ("linux", {"ID": "plan9"}, "DRJIT_LIBLLVM_PATH"),
        ("linux", {}, "DRJIT_LIBLLVM_PATH"),
        ("darwin", {}, "brew install llvm"),
    ],
)
def test_one_line_to_install_it(platform: str, release: dict, line: str) -> None:
    assert line in install_line(platform=platform, release=release)


# ---- the door ----


def test_without_mitsuba_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    with pytest.raises(MissingExtraError, match=r"^this needs Mitsuba: pip install 'prelight\[bake\]'$"):
        variant.mitsuba()


def test_without_llvm_the_install_line_is_named_before_anything_is_loaded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delitem(sys.modules, "drjit", raising=False)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: object())
    monkeypatch.setattr(variant, "find_llvm", lambda: None)
    monkeypatch.setattr(variant, "cuda_present", lambda: False)
    monkeypatch.setattr(variant, "install_line", lambda: "do this")
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(MissingExtraError, match=r"LLVM 19 or newer, none was found: do this$"):
        variant.mitsuba()
    assert "drjit" not in sys.modules


needs_mitsuba = pytest.mark.skipif(
    importlib.util.find_spec("mitsuba") is None or find_llvm() is None, reason="no Mitsuba or no LLVM here"
)


def run(code: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **environment},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@needs_mitsuba
def test_the_variant_is_set_once_and_other_threads_have_it() -> None:
    mi = variant.mitsuba()
    assert mi.variant() in variant.VARIANTS
    found = []
    thread = threading.Thread(target=lambda: found.append((variant.mitsuba(), mi.variant())))
    thread.start()
    thread.join()
    assert found == [(mi, mi.variant())]


@needs_mitsuba
def test_a_useless_choice_of_library_is_replaced_before_drjit_sees_it() -> None:
    code = (
        "import sys; from prelight.scene import variant; assert 'mitsuba' not in sys.modules; "
        "mi = variant.mitsuba(); import drjit; print(mi.variant(), drjit.detail.llvm_version()[0])"
    )
    name, major = run(code, DRJIT_LIBLLVM_PATH=os.devnull).split()
    assert name in variant.VARIANTS
    assert int(major) >= 19


OLD = next((entry for entry in all_llvm() if entry.numbers[0] in (15, 16)), None)


@needs_mitsuba
@pytest.mark.skipif(OLD is None, reason="no LLVM 15 or 16 here, which would abort")
@pytest.mark.parametrize("already", ["", "mitsuba.set_variant('llvm_ad_rgb')"])
def test_an_old_library_that_drjit_has_loaded_before_us_is_refused(already: str) -> None:
    code = f"""
import mitsuba
{already}
from prelight.errors import MissingExtraError
from prelight.scene import variant
try:
    print(variant.mitsuba().variant())
except MissingExtraError as error:
    print(error)
"""
    said = run(code, DRJIT_LIBLLVM_PATH=str(OLD.path))
    assert said.startswith(f"Dr.Jit has loaded LLVM {OLD.numbers[0]}.") or said == "cuda_ad_rgb"
    assert "DRJIT_LIBLLVM_PATH=" in said or said == "cuda_ad_rgb"


@needs_mitsuba
def test_a_variant_of_another_kind_is_not_changed_behind_the_callers_back() -> None:
    code = """
import mitsuba
mitsuba.set_variant("scalar_rgb")
from prelight.errors import InputError
from prelight.scene import variant
try:
    variant.mitsuba()
except InputError as error:
    print(error, mitsuba.variant())
"""
    assert run(code).endswith("call mitsuba.set_variant('llvm_ad_rgb') first scalar_rgb")
