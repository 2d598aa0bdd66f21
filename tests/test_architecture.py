"""Rules that a reader of the tree can rely on. See docs/architecture.md and CONTRIBUTING.md."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from functools import cache
from importlib.metadata import packages_distributions
from itertools import chain
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "prelight"
MODULES = sorted(SOURCE.rglob("*.py"))
PYTHON = sorted(chain(MODULES, *((ROOT / f).rglob("*.py") for f in ("tests", "benchmarks", "scripts"))))
TEXT = sorted(
    p
    for folder in ("src", "tests", "docs", "scripts", "benchmarks", ".ci", ".")
    for p in (ROOT / folder).glob("**/*" if folder != "." else "*")
    if p.suffix in {".py", ".md", ".sh", ".toml", ".lock", ".json", ""}
    and "node_modules" not in p.parts
    and p.is_file()
)

LINES_OF_A_FILE = 400
LINES_OF_A_FUNCTION = 80
DRAWERS = {"util", "utils", "misc", "common", "helper", "helpers", "core", "base", "manager", "tools"}
SLOW_TO_IMPORT = {"numba", "mitsuba", "drjit", "trimesh", "OpenEXR", "scipy", "zarr"}
# By mitsuba, by numba (each pins the version it needs), and by whoever hands us trimesh's objects.
BROUGHT_BY_OTHERS = {"drjit", "llvmlite", "trimesh"}
LOADED_BY_OTHERS = {"websockets"}  # by uvicorn, for the studio's socket
RUNS_FOREIGN_CODE = {"pickle", "marshal", "shelve", "dill", "joblib", "yaml", "code", "runpy"}


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def imported(path: Path) -> set[str]:
    """Top-level names of the absolute imports of a file."""
    found = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found.add((node.module or "").split(".")[0])
    return found


def test_the_import_contract_is_kept() -> None:
    run = subprocess.run(
        [sys.executable, "-c", "from importlinter.cli import lint_imports_command as c; c()",
         "--no-logo", "--no-cache"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr


def test_no_module_imports_the_root() -> None:
    """Cycles come from facades: only users import the names that the root package re-exports."""
    guilty = []
    for path in MODULES:
        depth = len(path.relative_to(SOURCE).parts)
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Import) and any(a.name.split(".")[0] == "prelight" for a in node.names):
                guilty.append(f"{name(path)}:{node.lineno}")
            if isinstance(node, ast.ImportFrom):
                root = (node.module or "").split(".")[0] == "prelight" and not node.level
                facade = node.level == depth and node.module is None and path != SOURCE / "__init__.py"
                if root or (facade and any(not is_module(SOURCE / a.name) for a in node.names)):
                    guilty.append(f"{name(path)}:{node.lineno}")
    assert not guilty, "import the module that defines the name, relatively"


def is_module(stem: Path) -> bool:
    return stem.is_dir() or stem.with_suffix(".py").is_file()


def test_packages_hold_only_a_docstring() -> None:
    for path in SOURCE.rglob("*/__init__.py"):
        body = tree(path).body
        assert ast.get_docstring(tree(path)), f"{name(path)}: say what the folder is, and what to read first"
        assert len(body) == 1, f"{name(path)}: only a docstring; import the defining module instead"


def test_nothing_is_called_a_drawer() -> None:
    parts = {part for path in PYTHON for part in path.relative_to(ROOT).with_suffix("").parts}
    assert not parts & DRAWERS, "name a file for its noun or its act"


@pytest.mark.parametrize("path", PYTHON, ids=name)
def test_files_and_functions_are_short(path: Path) -> None:
    lines = len(path.read_text(encoding="utf-8").splitlines())
    assert lines <= LINES_OF_A_FILE, "is there a second noun inside?"
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.FunctionDef):
            first = node.body[1 if ast.get_docstring(node) and len(node.body) > 1 else 0]
            length = (node.end_lineno or 0) - first.lineno + 1  # of its body, without the docstring
            assert length <= LINES_OF_A_FUNCTION, f"{node.name} has {length} lines"


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_nothing_runs_foreign_code_or_prints(path: Path) -> None:
    assert not imported(path) & RUNS_FOREIGN_CODE
    banned = {"eval", "exec", "breakpoint"} | (set() if path.is_relative_to(SOURCE / "cli") else {"print"})
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Call):
            called = getattr(node.func, "id", None)
            assert called not in banned, f"line {node.lineno}: {called}"
            risky = {k.arg for k in node.keywords if getattr(k.value, "value", None) is True}
            assert not risky & {"allow_pickle", "shell"}, f"line {node.lineno}: {risky}"


@pytest.mark.parametrize("module", ["prelight", "prelight.cli.main"])
def test_importing_is_light(module: str) -> None:
    """`prelight --help` must not wait for compilers and renderers."""
    code = f"import sys, {module}; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert not set(run.stdout.split()) & SLOW_TO_IMPORT


def test_dependencies_are_declared_and_used() -> None:
    def spelled(requirement: str) -> str:
        return re.split(r"[<>=!~ \[]", requirement)[0].lower().replace("_", "-")

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    declared = {
        spelled(r) for r in project["dependencies"] + extras["bake"] + extras["film"] + extras["notebook"]
    }
    owner = packages_distributions()
    used = {
        spelled(owner.get(module, [module])[0])
        for module in set().union(*map(imported, MODULES)) - sys.stdlib_module_names - {"prelight"}
    }
    assert used - BROUGHT_BY_OTHERS == declared - LOADED_BY_OTHERS


def test_the_lock_is_hashed_and_names_no_server() -> None:
    lock = (ROOT / "requirements.lock").read_text()
    assert "://" not in lock
    assert not re.search(r"^--|^-[a-z]", lock, re.M)
    entries = re.split(r"\n(?=\S)", lock.strip())
    assert all("==" in entry and "--hash=sha256:" in entry for entry in entries)


@pytest.mark.parametrize("path", TEXT, ids=name)
def test_no_stubs_and_no_paths_of_one_machine(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"/(?:home|root|Users|work|mnt)/\w", text), "a path of one machine"
    if path.suffix == ".py" and path != Path(__file__).resolve():
        assert not re.search(r"\b(?:TODO|FIXME|XXX|NotImplementedError)\b", text), "finish it or leave it out"
