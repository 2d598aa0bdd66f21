"""Finding an LLVM library that Dr.Jit can use.

Dr.Jit refuses LLVM 14, and accepts 15 and 16 but then aborts the whole process in most kernels, so the choice
is never left to it. Versions are read from names first: two LLVM libraries in one process can abort too.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

OLDEST_LLVM = 19
_PATTERNS = ("libLLVM*.so*", "libLLVM*.dylib")
_FOLDERS = (
    "/usr/lib", "/usr/lib64", "/usr/lib/*-linux-gnu", "/usr/lib/llvm*/lib", "/usr/lib64/llvm*/lib*",
    "/usr/lib/llvm/*/lib*", "/usr/local/lib", "/usr/local/lib64", "/usr/local/llvm*/lib",
    "/usr/local/opt/llvm*/lib", "/opt/homebrew/opt/llvm*/lib", "/opt/llvm*/lib",
)  # fmt: skip
_VERSION = r"(\d+)(?:\.(\d+))?(?:\.(\d+))?"
# libLLVM-19.so.1, libLLVM-14.0.6.so and libLLVM.so.19.1, but not libLLVM-19-rust-1.80.so.
_IN_NAME = re.compile(rf"libLLVM-{_VERSION}\.(?:so|dylib)|libLLVM\.so\.{_VERSION}")
_IN_FOLDER = re.compile(rf"/llvm[-@/]?{_VERSION}(?=/|$)", re.IGNORECASE)
_ASK = """
import ctypes, sys
version = [ctypes.c_uint() for _ in range(3)]
ctypes.CDLL(sys.argv[1]).LLVMGetVersion(*map(ctypes.byref, version))
print(*(part.value for part in version))
"""


@dataclass(frozen=True, order=True)
class LlvmLibrary:
    """A shared LLVM library for this kind of processor."""

    numbers: tuple[int, ...]  # of the version, as far as the name tells: (19, 1)
    path: Path

    @property
    def version(self) -> str:
        return ".".join(str(number) for number in self.numbers)

    @property
    def usable(self) -> bool:
        return self.numbers[0] >= OLDEST_LLVM


def find_llvm(
    *, chosen: str | None = None, folders: Iterable[str | Path] | None = None, linker: bool = True
) -> LlvmLibrary | None:
    """The LLVM library to use: ``chosen`` if it is usable, else the newest usable one, else None.

    Parameters
    ----------
    chosen
        A library's path; by default what the user's DRJIT_LIBLLVM_PATH says.
    folders
        Where to look, with ``*``; the system's usual folders by default.
    linker
        Whether to ask the dynamic linker (``ldconfig -p``) too.
    """
    if chosen is None:
        chosen = os.environ.get("DRJIT_LIBLLVM_PATH")
    if chosen:
        wanted = identify(Path(chosen))
        if wanted is not None and wanted.usable:
            return wanted
    return max((library for library in all_llvm(folders, linker=linker) if library.usable), default=None)


def all_llvm(folders: Iterable[str | Path] | None = None, *, linker: bool = True) -> list[LlvmLibrary]:
    """Every LLVM library found, usable or not, each file once; for reports."""
    searched = (*_FOLDERS, f"{sys.prefix}/lib") if folders is None else folders
    paths = [path for folder in searched for path in _in_folders(str(folder))]
    if linker:
        paths += _known_to_linker()
    found: dict[Path, LlvmLibrary] = {}
    for path in sorted(paths):
        real = path.resolve()
        if real not in found and (library := identify(path)) is not None:
            found[real] = library
    return sorted(found.values())


def _in_folders(pattern: str) -> list[Path]:
    root = Path(Path(pattern).anchor)
    matches = root.glob(str(Path(pattern).relative_to(root))) if "*" in pattern else [Path(pattern)]
    try:
        return [path for folder in matches for name in _PATTERNS for path in folder.glob(name)]
    except OSError:
        return []


def _known_to_linker() -> list[Path]:
    for program in ("ldconfig", "/sbin/ldconfig"):
        try:
            listed = subprocess.run([program, "-p"], capture_output=True, text=True, timeout=10, check=True)
        except (OSError, subprocess.SubprocessError):
            continue
        return [
            Path(m.group(1)) for m in re.finditer(r"=> (\S*/libLLVM\S*\.so\S*)$", listed.stdout, re.MULTILINE)
        ]
    return []


def identify(path: Path) -> LlvmLibrary | None:
    """The library at ``path``, or None where there is none for this processor or its version is unknown."""
    try:
        if not path.is_file() or not _for_this_processor(path):
            return None
        real = path.resolve()
    except OSError:
        return None
    in_folders = (_IN_FOLDER, (str(path.parent), str(real.parent)))
    for pattern, texts in ((_IN_NAME, (path.name, real.name)), in_folders):
        matches = [match for text in texts if (match := pattern.search(text))]
        versions = [tuple(int(part) for part in match.groups() if part is not None) for match in matches]
        if versions:
            return LlvmLibrary(max(versions, key=len), path)
    version = _asked(path) if path.name in ("libLLVM.so", "libLLVM.dylib") else None
    return None if version is None else LlvmLibrary(version, path)


def _for_this_processor(path: Path) -> bool:
    """Whether an ELF file has the word size, byte order and machine of this Python; others pass."""
    with path.open("rb") as file:
        theirs = file.read(20)
    if theirs[:4] != b"\x7fELF":
        return sys.platform != "linux" and len(theirs) == 20
    running = Path("/proc/self/exe")
    with (running if running.exists() else Path(sys.executable)).open("rb") as file:
        ours = file.read(20)
    return ours[:4] != b"\x7fELF" or (ours[4:6], ours[18:20]) == (theirs[4:6], theirs[18:20])


def _asked(path: Path) -> tuple[int, ...] | None:
    """The version that the library itself gives, asked in a process of its own."""
    try:
        answer = subprocess.run(
            [sys.executable, "-I", "-c", _ASK, str(path)],
            capture_output=True,
            text=True,
            timeout=30,
            check=True,
        )
        major, minor, patch = (int(part) for part in answer.stdout.split())
    except (OSError, ValueError, subprocess.SubprocessError):
        return None
    return major, minor, patch


def install_line(*, platform: str = sys.platform, release: Mapping[str, str] | None = None) -> str:
    """The one command that brings what Dr.Jit needs to this system (``release``: its os-release)."""
    if platform == "darwin":
        return "brew install llvm libomp"
    if release is None:
        release = _os_release()
    names = {release.get("ID", ""), *release.get("ID_LIKE", "").split()}
    for known, line in (
        ({"debian", "ubuntu"}, f"sudo apt-get install -y libllvm{OLDEST_LLVM} libgomp1 libatomic1"),
        ({"fedora", "rhel", "centos"}, "sudo dnf install -y llvm-libs libgomp libatomic"),
        ({"arch"}, "sudo pacman -S --needed llvm-libs gcc-libs"),
        ({"suse", "opensuse"}, f"sudo zypper install -y libLLVM{OLDEST_LLVM} libgomp1 libatomic1"),
    ):
        if names & known:
            return line
    return f"install the shared library of LLVM {OLDEST_LLVM} or newer and set DRJIT_LIBLLVM_PATH to it"


def _os_release() -> dict[str, str]:
    for name in ("/etc/os-release", "/usr/lib/os-release"):
        try:
            lines = Path(name).read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            continue
        pairs = (line.split("=", 1) for line in lines if "=" in line)
        return {key.strip(): value.strip().strip("\"'") for key, value in pairs}
    return {}
