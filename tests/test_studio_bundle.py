"""The built page: it is what its sources give, small, and has no part that another site would have to serve."""

from __future__ import annotations

import gzip
import hashlib
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
WEB = ROOT / "src/prelight/studio/web"
BUILT = WEB / "built"
BESIDE = ("package-lock.json", "package.json", "tsconfig.json", "vite.config.js")


def test_the_bundle_is_of_these_sources():
    """Without building: the digest that the build wrote is that of the sources as they are."""
    paths = [path.relative_to(WEB).as_posix() for path in (WEB / "source").rglob("*") if path.is_file()]
    digest = hashlib.sha256()
    for path in sorted([*paths, *BESIDE]):
        digest.update(f"{path}\0".encode() + (WEB / path).read_bytes() + b"\0")
    built = (BUILT / "sources.sha256").read_text().strip()
    assert built == digest.hexdigest(), "the page is older than its sources: bash scripts/build_studio.sh"


def test_a_rebuild_gives_the_same_bytes():
    done = subprocess.run(
        ["bash", str(ROOT / "scripts/check_studio.sh")],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    if done.returncode == 3:
        pytest.skip(done.stderr.strip().splitlines()[-1])
    assert done.returncode == 0, done.stderr


def test_the_page_is_small_and_whole():
    files = {path.name for path in BUILT.iterdir()}
    assert files == {"index.html", "studio.js", "studio.css", "icon.png", "licenses.md", "sources.sha256"}
    assert sum(len(gzip.compress(path.read_bytes())) for path in BUILT.iterdir()) < 1_000_000
    assert "Permission is hereby granted" in (BUILT / "licenses.md").read_text()


def test_nothing_inline_and_nothing_from_elsewhere():
    """What a strict content security policy refuses, and what would make it useless offline."""
    page = (BUILT / "index.html").read_text()
    assert re.findall(r"<script[^>]*>(.*?)</script>", page) == [""]
    assert not re.search(r"<style|\sstyle=|\son\w+=|https?:", page)
    assert re.findall(r'(?:src|href)="([^"]*)"', page) == ["./icon.png", "./studio.js", "./studio.css"]
    style = (BUILT / "studio.css").read_text()
    assert not re.search(r"url\(|@import|@font-face", style)
    script = (BUILT / "studio.js").read_text()
    assert not re.search(r"\beval\(|new Function\(|\.innerHTML|insertAdjacentHTML|document\.write", script)


def test_sources_keep_the_size_of_a_page():
    """As Python modules: 400 lines at most; and text is the only thing that is made of what others wrote."""
    for path in (WEB / "source").rglob("*.ts"):
        text = path.read_text()
        assert len(text.splitlines()) <= 400, path.name
        assert not re.search(
            r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|(:|<|as) ?any\b", text
        ), path.name
