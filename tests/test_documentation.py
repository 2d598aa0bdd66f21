"""What the documents say can be followed: links lead somewhere, code compiles, names and commands exist."""

from __future__ import annotations

import ast
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
LANGUAGES = {"sh", "python", "text", "json", "toml"}
NOT_OURS = {"uv.lock", "pylock.toml", "docs/decisions/NNNN-title.md"}  # named as examples
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.M | re.S)


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def blocks(path: Path, language: str) -> list[str]:
    return [code for tag, code in BLOCK.findall(path.read_text(encoding="utf-8")) if tag == language]


@pytest.mark.parametrize("path", DOCUMENTS, ids=name)
def test_links_lead_somewhere(path: Path) -> None:
    text = BLOCK.sub("", path.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", text):
        if "://" not in target:
            assert (path.parent / target).exists(), f"{target} does not exist"


@pytest.mark.parametrize("path", DOCUMENTS, ids=name)
def test_named_files_exist(path: Path) -> None:
    """Paths in backquotes, such as `bases/cube_map.py`, from the root or inside the package."""
    text = BLOCK.sub("", path.read_text(encoding="utf-8"))
    for target in re.findall(r"`(\w[\w.-]*/[\w./-]*|[\w-]+\.(?:py|md|toml|lock))`", text):
        found = (ROOT / target).exists() or any((ROOT / "src").rglob(target.rstrip("/")))
        assert found or target in NOT_OURS, f"{target} does not exist"


@pytest.mark.parametrize("path", DOCUMENTS, ids=name)
def test_blocks_say_their_language(path: Path) -> None:
    assert {tag for tag, _ in BLOCK.findall(path.read_text(encoding="utf-8"))} <= LANGUAGES


@pytest.mark.parametrize("path", [p for p in DOCUMENTS if blocks(p, "python")], ids=name)
def test_python_uses_public_names_only(path: Path) -> None:
    import prelight

    for code in blocks(path, "python"):
        for node in ast.walk(ast.parse(code)):
            if isinstance(node, ast.Attribute) and getattr(node.value, "id", None) == "pl":
                assert hasattr(prelight, node.attr), f"prelight.{node.attr}"


def shown_commands() -> list[str]:
    lines = [line for path in DOCUMENTS for code in blocks(path, "sh") for line in code.splitlines()]
    return sorted({line for line in lines if line.startswith("prelight ")})


@pytest.mark.parametrize("command", shown_commands())
def test_shown_commands_have_these_options(command: str) -> None:
    """Each option shown is in the command's help; what is not a word of ours is an argument."""
    words = shlex.split(command, comments=True)[1:]
    ours = []
    for word in words:
        if not re.fullmatch(r"[a-z]+", word):
            break
        ours.append(word)
    run = subprocess.run(
        [sys.executable, "-c", "from prelight.cli.main import main; main()", *ours, "--help"],
        capture_output=True, text=True, check=False, env={**os.environ, "COLUMNS": "200"}, cwd=ROOT,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    for option in (w for w in words if w.startswith("-")):
        assert re.search(rf"(?<![\w-]){re.escape(option)}(?![\w-])", run.stdout), f"the help has no {option}"


def test_exit_codes_are_those_of_the_errors() -> None:
    from prelight import errors

    table = (ROOT / "docs" / "conventions.md").read_text(encoding="utf-8")
    documented = {int(code) for code in re.findall(r"^\| (\d+) \|", table, re.M)}
    raised = {c.exit_code for c in vars(errors).values() if isinstance(c, type) and issubclass(c, Exception)}
    assert raised <= documented
    assert documented - raised == {0}
