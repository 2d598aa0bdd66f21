"""Files that a file names: inside its folder, or not read."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from prelight.errors import InputError
from prelight.files import Resolver


def test_the_resolver_reads_inside_its_folder_alone(tmp_path: Path) -> None:
    root = tmp_path / "root"
    (root / "a").mkdir(parents=True)
    (root / "a" / "b c%20d.png").write_bytes(b"inside")
    (tmp_path / "root-x").write_bytes(b"outside")
    os.symlink("a", root / "alias")
    os.symlink("../root-x", root / "leak")
    files = Resolver(root)
    for name in ("a/b c%20d.png", "./a//b c%20d.png", "a/../a/b c%20d.png", "alias/b c%20d.png"):
        assert files.read(name, limit=6) == b"inside"
    assert files.read("a/b%20c%2520d.png", limit=6, uri=True) == b"inside"  # decoded once
    os.symlink(root, tmp_path / "link")
    assert Resolver(tmp_path / "link").read("a/b c%20d.png", limit=6) == b"inside"
    refusals = {
        "../root-x": "leads out", "leak": "leads out", "a/../../root-x": "leads out", ".": "leads out",
        "../root/../root-x": "leads out", "": "expected a file's name", "a\0": "expected a file's name",
        "a\nb": "expected a file's name", "a\ud800": "expected a file's name", "/etc/passwd": "relative to the file",
        "//x/y": "relative to the file", "file:a": "relative to the file", "C:/a": "relative to the file",
        "a\\b": "not a backslash", "a": "regular file", "absent": "no such file", "x" * 300: "name too long",
        "a/b c%20d.png/x": "Not a directory",
    }  # fmt: skip
    for name, reason in refusals.items():
        with pytest.raises(InputError) as caught:
            files.read(name, limit=6)
        assert caught.value.path == name
        assert reason.lower() in str(caught.value).lower()
        assert str(caught.value).isprintable()
    for name in ("%2e%2e/root-x", "%2Fetc%2Fpasswd", "a%00", "%ff", "file%3Aa", "a%5Cb"):
        with pytest.raises(InputError):
            files.read(name, limit=6, uri=True)
    with pytest.raises(InputError, match="6 bytes, at most 5 bytes are read"):
        files.read("a/b c%20d.png", limit=5)
