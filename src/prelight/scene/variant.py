"""The one door to Mitsuba: everything that needs it calls `mitsuba()`."""

from __future__ import annotations

import ctypes
import importlib.util
import os
import sys
import threading
from types import ModuleType

from ..errors import InputError, MissingExtraError
from .llvm import OLDEST_LLVM, find_llvm, install_line

VARIANTS = ("cuda_ad_rgb", "metal_ad_rgb", "llvm_ad_rgb")  # in order of preference
_DOOR = threading.Lock()


def mitsuba() -> ModuleType:
    """Mitsuba with its variant set: CUDA or Metal where this machine has it, otherwise LLVM.

    The variant is chosen once a process; call it in the main thread first, then in any thread. A variant of
    `VARIANTS` that the caller has set stays.

    Raises MissingExtraError with the one command that helps, InputError if another variant is set.
    """
    with _DOOR:
        mi = _imported()
        current = mi.variant()
        if current is None:
            current = _usable_variant(mi)
            mi.set_variant(current)
        if current not in VARIANTS:
            reason = f"Mitsuba is set to {current}; call mitsuba.set_variant('llvm_ad_rgb') first"
            raise InputError("variant", reason)
        if current.startswith("llvm"):
            _check_loaded_llvm()
        return mi


def on_processor() -> None:
    """Trace on the processor, whatever else is there; before anything is traced. Raises as ``mitsuba``."""
    with _DOOR:
        _imported().set_variant("llvm_ad_rgb")


def usable_devices() -> tuple[str, ...]:
    """Where rays can be traced here: "gpu" before "cpu". Raises as ``mitsuba``."""
    return ("cpu",) if mitsuba().variant().startswith("llvm") and not cuda_present() else ("gpu", "cpu")


def _imported() -> ModuleType:
    """Mitsuba, with Dr.Jit told which LLVM to load: it loads one when it is imported."""
    if importlib.util.find_spec("mitsuba") is None:
        raise MissingExtraError("this needs Mitsuba: pip install 'prelight[bake]'")
    if "drjit" not in sys.modules:
        library = find_llvm()
        if library is not None:
            os.environ["DRJIT_LIBLLVM_PATH"] = str(library.path)
        elif not (cuda_present() or sys.platform == "darwin"):
            raise _missing_llvm("none was found")
    try:
        import mitsuba as mi
    except ImportError as error:
        # Most often libatomic, which the install line names too.
        raise MissingExtraError(f"Mitsuba does not start, {error}: {install_line()}") from None
    return mi


def _usable_variant(mi: ModuleType) -> str:
    import drjit

    there = set(mi.variants())
    if "cuda_ad_rgb" in there and cuda_present() and drjit.has_backend(drjit.JitBackend.CUDA):
        return "cuda_ad_rgb"
    metal = getattr(drjit.JitBackend, "Metal", None)
    if "metal_ad_rgb" in there and metal is not None and drjit.has_backend(metal):
        return "metal_ad_rgb"
    _check_loaded_llvm()
    return "llvm_ad_rgb"


def _check_loaded_llvm() -> None:
    """What Dr.Jit has really loaded: another package may have imported it before us."""
    import drjit

    version = tuple(drjit.detail.llvm_version())
    if version[0] < 0:
        raise _missing_llvm("none was found")
    if version[0] < OLDEST_LLVM:
        loaded = ".".join(str(part) for part in version)
        better = find_llvm()
        if better is None:
            raise _missing_llvm(f"Dr.Jit has loaded {loaded}, which aborts")
        remedy = f"start again with DRJIT_LIBLLVM_PATH={better.path}"
        raise MissingExtraError(f"Dr.Jit has loaded LLVM {loaded}, which aborts: {remedy}")


def _missing_llvm(what: str) -> MissingExtraError:
    return MissingExtraError(f"Mitsuba needs LLVM {OLDEST_LLVM} or newer, {what}: {install_line()}")


def cuda_present() -> bool:
    """Whether the driver answers with a device and has OptiX, without which CUDA cannot trace rays."""
    if sys.platform != "linux":
        return False
    try:
        driver = ctypes.CDLL("libcuda.so.1")
        ctypes.CDLL("libnvoptix.so.1")
        count = ctypes.c_int()
        return driver.cuInit(0) == 0 and driver.cuDeviceGetCount(ctypes.byref(count)) == 0 and count.value > 0
    except (OSError, AttributeError):
        return False
