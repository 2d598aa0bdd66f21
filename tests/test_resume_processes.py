"""Real processes that bake: killed, interrupted, or two at once."""

from __future__ import annotations

import contextlib
import os
import random
import resource
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from prelight.errors import OutputError
from prelight.scene.geometry import Scene
from prelight.storage.journal import BakeWriter, partial_folder

from .disk import quick_bake, tree
from .scenes import ball_on_floor

KILLS = int(os.environ.get("PRELIGHT_KILLS", "6"))  # 200 before a release
ROOT = Path(__file__).resolve().parents[1]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT / "src")}


HOLDER = """
import sys, time
from pathlib import Path
from prelight.storage.journal import BakeWriter
BakeWriter(Path(sys.argv[1]), settings={}, resume=True, force=False)
print("held", flush=True)
time.sleep(60)
"""


def test_two_writers_are_refused(tmp_path):
    """P8: in one process or two; a dead one's lock counts no longer."""
    target = tmp_path / "ball.prelight"
    mine = BakeWriter(target, settings={}, resume=False, force=False)
    for options in ({"resume": True}, {"force": True}, {}):
        with pytest.raises(OutputError, match="another process"):
            quick_bake(target, **options)
    mine.close()
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(target)], stdout=subprocess.PIPE, env=ENVIRONMENT
    ) as holder:
        assert holder.stdout.readline() == b"held\n"
        before = tree(tmp_path)
        for options in ({"resume": True}, {"force": True}, {}):
            with pytest.raises(OutputError, match="another process"):
                quick_bake(target, **options)
        assert tree(tmp_path) == before
        holder.kill()
    quick_bake(target, force=True)
    assert [p.name for p in tmp_path.iterdir()] == ["ball.prelight"]


BAKER = """
import os, sys
sys.path.insert(0, sys.argv[1])
from prelight.baking.environment import bake_planned
from prelight.baking.environment_plan import Cut, EnvironmentPlan
from prelight.baking.environment_settings import EnvironmentSettings
from tests.scenes import ball_on_floor

scene = ball_on_floor()
figures = dict.fromkeys(("clusters", "rays", "receiver_directions", "seconds", "memory", "bytes"), 1)
plan = EnvironmentPlan(
    settings=EnvironmentSettings(resolution=24, zones=3), receivers=len(scene.positions),
    triangles=len(scene.triangles), zones=3, tolerance=0.0135, cuts=(Cut(1 << 18, 48),) * 3, **figures,
)
bake_planned(scene, sys.argv[2], plan=plan, resume=True, report=lambda *_: print("working", flush=True))
print("done", flush=True)
"""


def bake_in_a_process(target: Path, *, until: float | None = None) -> float:
    """Bake with the real renderer, or kill -9 the baker so many seconds after its first report; seconds it ran."""
    command = [sys.executable, "-c", BAKER, str(ROOT), str(target)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT) as baker:
        first = baker.stdout.readline()  # "done" at once where the killed baker had only to publish
        assert first
        started = time.perf_counter()
        if until is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                baker.wait(until)
            baker.kill()
        words = [*first.split(), *baker.stdout.read().split()]
        assert until is not None or words[-1] == "done"
    return time.perf_counter() - started


def killed_until_done(folder: Path, *, kills: int, seed: int, lasts: float) -> list[dict[str, str]]:
    """Trees of the bakes that so many kills, at random times, fell upon."""
    random_times = random.Random(seed)
    trees = []
    while kills:
        target = folder / f"{seed}-{len(trees)}.prelight"
        while kills and not target.exists():
            bake_in_a_process(target, until=random_times.uniform(0, 0.7 * lasts))
            kills -= 1
        if not target.exists():
            bake_in_a_process(target)
        trees.append(tree(target))
    return trees


def test_kill_9_of_the_real_thing(tmp_path):
    """P1: processes with their renderer's threads, killed at random times, two at a time."""
    lasts = bake_in_a_process(tmp_path / "whole.prelight")
    with ThreadPoolExecutor(2) as pool:
        chains = [
            pool.submit(killed_until_done, tmp_path, kills=-(-KILLS // 2), seed=seed, lasts=lasts)
            for seed in (1, 2)
        ]
        trees = [found for chain in chains for found in chain.result()]
    assert trees == [tree(tmp_path / "whole.prelight")] * len(trees)


def write_ply(path: Path, scene: Scene) -> Path:
    head = ["ply", "format ascii 1.0", f"element vertex {len(scene.positions)}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"element face {len(scene.triangles)}", "property list uchar int vertex_indices", "end_header"]
    rows = [" ".join(map(str, p)) for p in scene.positions.tolist()]
    rows += ["3 " + " ".join(map(str, t)) for t in scene.triangles.tolist()]
    path.write_text("\n".join(head + rows) + "\n")
    return path


def processor_seconds(process: int) -> float:
    """What a process that runs has used so far, in all its threads."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def children_seconds() -> float:
    """What all processes that we waited for have used."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def ended(process: subprocess.Popen[str]) -> tuple[str, str]:
    """What it says until it ends; one that does not within a minute is killed, and the test fails."""
    try:
        return process.communicate(timeout=60)
    except subprocess.TimeoutExpired:
        process.kill()
        raise


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks into /proc")
def test_ctrl_c_and_sigterm_of_the_command(tmp_path):
    """P10: stops within five seconds of the processor's, says how to go on, exit codes 130 and 143.

    Others on the machine do not count; twenty seconds in which it does nothing do.
    """
    mesh, target = write_ply(tmp_path / "ball.ply", ball_on_floor()), tmp_path / "ball.prelight"
    command = [sys.executable, "-c", "from prelight.cli.main import main; main()", "bake", "environment"]
    command += [str(mesh), "-o", str(target), "--resolution", "128", "--tolerance", "0.0005"]
    journal, done, others = partial_folder(target) / "journal.jsonl", 0, children_seconds()
    for stop, code, more in ((signal.SIGINT, 130, []), (signal.SIGTERM, 143, ["--resume"])):
        with subprocess.Popen(
            [*command, *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT
        ) as baker:
            deadline = time.monotonic() + 60
            while not journal.exists() or journal.read_bytes().count(b"\n") <= done + 1:
                assert baker.poll() is None, baker.stderr.read()
                assert time.monotonic() < deadline
                time.sleep(0.02)
            signalled, before = time.monotonic(), processor_seconds(baker.pid)
            baker.send_signal(stop)
            _, complaint = ended(baker)
            took = time.monotonic() - signalled
        stopped = children_seconds() - others - before
        others = children_seconds()
        assert 0 <= stopped < 5
        assert took - stopped < 20, "it slept, or a machine gives it next to nothing"
        assert baker.returncode == code
        assert complaint.startswith("prelight: ")
        assert complaint.count("\n") == 1
        assert "--resume" in complaint
        assert not target.exists()
        kept = journal.read_bytes().count(b"\n") - 1
        assert kept > done, "the work of the second run was lost"
        done = kept
    assert not list(tmp_path.glob(".*.lock"))
