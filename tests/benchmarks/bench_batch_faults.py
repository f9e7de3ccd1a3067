"""A batch on a cluster while things go wrong: does every survey end, none twice, none half?

    sudo python tests/benchmarks/bench_batch_faults.py

Linux, as root: a scheduler and three workers of Dask live in network namespaces of their own.
Twelve surveys: eight good ones, one that crashes its process, one that never ends, one that takes
all memory, and one whose output folder is full (a tmpfs of 64 kB). In the midst of a survey one
worker is killed (SIGKILL), and another is cut off (its link goes down, so nothing is closed); at
the end the link comes back. Printed: what each survey came to, how often it was begun and written,
seconds of the clock. Status 1 where a good survey did not come out as `uavgram run` measures it,
was written twice, left anything hidden behind, or where a bad one is not named.
"""

from __future__ import annotations

import contextlib
import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from uavgram.synthetic.demo import write_demo
from uavgram.synthetic.scenario import CameraSpec, Scenario
from uavgram.synthetic.survey import simulate

WORKERS, GOOD = 3, 8
BAD = ("crashes", "endless", "hungry", "full")
NET, PORT, MOST_MINUTES = f"10.{os.getpid() % 200 + 20}.7", 8786, 2.0
TAG = f"uvg{os.getpid() % 10000}"
WIDTH_PX, HEIGHT_PX = 600, 450
HARMFUL = """
import os, signal
from pathlib import Path
from uavgram.pipeline.batch import survey
measured = getattr(survey.run, "measured", survey.run)  # it may be loaded twice

def noted(path, **asked):
    name = Path(path).parent.name
    def note(word):
        with open(os.environ["JOURNAL"], "a") as file:
            file.write(f"{word} {name} {os.environ['WORKER']} {os.getpid()}\\n")
    note("begun")
    if name == "crashes":
        os.kill(os.getpid(), signal.SIGSEGV)
    while name == "endless":
        pass
    kept = []
    while name == "hungry":
        kept.append(bytearray(os.urandom(1 << 20)) * 64)
    made = measured(path, **asked)
    note("written")
    return made

noted.measured = measured
survey.run = noted
"""
"""Loaded by the workers (dask worker --preload): what bad surveys do, and a journal."""


def ip(*words: object) -> None:
    """Change the network."""
    subprocess.run(["ip", *map(str, words)], check=True)


@contextlib.contextmanager
def network() -> Iterator[None]:
    """A bridge, and a namespace on it for the scheduler (0) and for each worker."""
    try:
        ip("link", "add", TAG, "type", "bridge")
        ip("addr", "add", f"{NET}.254/24", "dev", TAG)
        ip("link", "set", TAG, "up")
        for k in range(WORKERS + 1):
            space, outer, inner = f"{TAG}n{k}", f"{TAG}o{k}", f"{TAG}i{k}"
            ip("netns", "add", space)
            ip("link", "add", outer, "type", "veth", "peer", "name", inner, "netns", space)
            ip("link", "set", outer, "master", TAG, "up")
            ip("-n", space, "addr", "add", f"{NET}.{k + 1}/24", "dev", inner)
            ip("-n", space, "link", "set", inner, "up")
            ip("-n", space, "link", "set", "lo", "up")
        yield
    finally:
        for k in range(WORKERS + 1):
            subprocess.run(["ip", "netns", "del", f"{TAG}n{k}"], check=False, capture_output=True)
        subprocess.run(["ip", "link", "del", TAG], check=False, capture_output=True)


def inside(k: int, folder: Path, *words: str) -> subprocess.Popen[bytes]:
    """A program of Dask in a namespace, with all of its children in a group of their own."""
    own = os.environ | {
        "WORKER": str(k),
        "JOURNAL": str(folder / "journal.txt"),
        "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "60s",  # five minutes, if nothing is said
    }
    with (folder / f"dask{k}.txt").open("wb") as log:
        return subprocess.Popen(
            ["ip", "netns", "exec", f"{TAG}n{k}", sys.executable, "-m", *words],
            env=own, cwd=folder, stdout=log, stderr=log, start_new_session=True,
        )  # fmt: skip


@contextlib.contextmanager
def cluster(folder: Path) -> Iterator[None]:
    """A scheduler and its workers."""
    begun = [
        inside(0, folder, "distributed.cli.dask_scheduler", "--host", f"{NET}.1", "--no-dashboard")
    ]
    try:
        for k in range(1, WORKERS + 1):
            words = ("--nthreads", "1", "--memory-limit", "1.5GB", "--no-dashboard")
            preload = ("--preload", str(folder / "harmful.py"), "--host", f"{NET}.{k + 1}")
            program = "distributed.cli.dask_worker"
            begun.append(inside(k, folder, program, f"tcp://{NET}.1:{PORT}", *words, *preload))
        yield
    finally:
        for process in begun:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def make_surveys(folder: Path) -> None:
    """One survey measured by `uavgram run`, and all others as copies of its inputs."""
    scale = WIDTH_PX / CameraSpec().width_px
    pixels = [scale] * 4 + [1.0] * 5
    camera = CameraSpec(
        width_px=WIDTH_PX,
        height_px=HEIGHT_PX,
        parameters=tuple(np.multiply(CameraSpec().parameters, pixels).tolist()),
        sigma=tuple(np.multiply(CameraSpec().sigma, pixels).tolist()),
    )
    survey = simulate(replace(Scenario(), camera=camera))
    photos = (np.full((HEIGHT_PX, WIDTH_PX, 3), 90, np.uint8) for _ in survey.frame_id)
    project = write_demo(folder / "reference", survey, photos)
    for name in (*(f"good{k}" for k in range(GOOD)), *BAD):
        shutil.copytree(folder / "reference", folder / "all" / name)
    command = [sys.executable, "-m", "uavgram", "run", str(project)]
    subprocess.run(command, check=True, capture_output=True)


def told(out: Path) -> object:
    """results.json without the moment of its making and the photos' place."""
    content = json.loads((out / "results.json").read_text(encoding="utf-8"))
    del content["provenance"]
    for frame in content["frames"]:
        del frame["path"]
    return content


def wait_for(
    found: Callable[[], tuple[str, ...] | None], seconds: float = 900.0
) -> tuple[str, ...]:
    """What is found, as soon as it is."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if (one := found()) is not None:
            return one
        time.sleep(0.02)
    raise TimeoutError


def busy(journal: Path, but: str = "") -> tuple[str, ...] | None:
    """A good survey that is being measured: its name, the worker (not that one), its process."""
    lines = journal.read_text().splitlines() if journal.exists() else []
    newest = {
        worker: (word, name, process) for word, name, worker, process in map(str.split, lines)
    }
    for worker, (word, name, process) in newest.items():
        if worker != but and word == "begun" and name.startswith("good"):
            return name, worker, process
    return None


def harm(folder: Path) -> str:
    """Kill a worker and cut off another, each in the midst of a survey; the number of that one."""
    name, killed, process = wait_for(lambda: busy(folder / "journal.txt"))
    os.kill(int(process), signal.SIGKILL)
    say(f"worker {killed} killed while it measured {name}")
    name, cut, _ = wait_for(lambda: busy(folder / "journal.txt", killed))
    ip("link", "set", f"{TAG}o{cut}", "down")
    say(f"worker {cut} cut off while it measured {name}")
    return cut


def faults(folder: Path) -> list[str]:
    """What is not as it must be."""
    with (folder / "batch" / "batch.csv").open(encoding="utf-8", newline="") as stream:
        rows = {Path(row["project"]).parent.name: row for row in csv.DictReader(stream)}
    journal = [line.split() for line in (folder / "journal.txt").read_text().splitlines()]
    begun = Counter(line[1] for line in journal if line[0] == "begun")
    written = Counter(line[1] for line in journal if line[0] == "written")
    reference = folder / "reference" / "out"
    expected, names = told(reference), {path.name for path in reference.iterdir()}
    wrong = []
    for name, row in sorted(rows.items()):
        say(
            f"{name}: {row['status']}, begun {begun[name]}, written {written[name]}: "
            f"{row['message']}"
        )
        out = folder / "all" / name / "out"
        if name in BAD:
            wrong += [f"{name} did not fail"] * (row["status"] != "failed" or not row["message"])
            continue
        if row["status"] != "done" or written[name] != 1:
            wrong.append(f"{name}: {row['status']}, written {written[name]} times")
        elif told(out) != expected or {path.name for path in out.iterdir()} != names:
            wrong.append(f"{name}: not what uavgram run gives")
    return wrong + ["a survey has no row"] * (len(rows) != GOOD + len(BAD))


def say(line: str) -> None:
    """Print at once, for whoever waits."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main() -> int:
    """Run the batch, do harm, and compare; status 1 where anything is wrong."""
    with tempfile.TemporaryDirectory() as scratch, contextlib.ExitStack() as stack:
        folder = Path(scratch)
        make_surveys(folder)
        (folder / "harmful.py").write_text(HARMFUL)
        full = folder / "all" / "full" / "out"
        full.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", TAG, str(full)], check=True)
        stack.callback(subprocess.run, ["umount", str(full)], check=True)
        stack.enter_context(network())
        stack.enter_context(cluster(folder))
        began = time.monotonic()
        words = ["batch", str(folder / "all"), "--output", str(folder / "batch")]
        words += ["--scheduler", f"tcp://{NET}.1:{PORT}", "--most-minutes", str(MOST_MINUTES)]
        batch = subprocess.Popen([sys.executable, "-m", "uavgram", *words])
        cut = harm(folder)
        batch.wait()
        say(
            f"the batch ended with status {batch.returncode} after {time.monotonic() - began:.0f} s"
        )
        ip("link", "set", f"{TAG}o{cut}", "up")
        time.sleep(20.0)
        wrong = faults(folder)
    say("; ".join(wrong) or "every survey ended, none twice, none half")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
