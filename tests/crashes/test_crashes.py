"""Power cuts on a real ext4: images of its device, taken while commands work on it.

The processes are halted while an image is copied, and the kernel writes nothing by itself meanwhile: two copies are the
same. So the image is what the device has been given, without what was only in memory. On each image nothing is damaged,
no part is missing that was reported as committed, and the next run ends with the bytes of an undisturbed one.
"""

import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release" / "stickslip"
# Of each kind.
IMAGES = int(os.environ.get("STICKSLIP_IMAGES", 20))
SIZE = 32 << 20

SWEEP = """
name = "crash"

[model]
N = 2
Ns = 2

[axes]
V0   = [1e-4, 2e-4]
seed = {{ count = {seeds} }}

[record]
slips = 300
discard = 0
"""


class Disk:
    def __init__(self, image, folder):
        self.image, self.folder = image, folder
        folder.mkdir()
        # No commits of the journal but those that are asked for.
        call("mount", "-o", "loop,commit=300", image, folder)

    def __enter__(self):
        return self.folder

    def __exit__(self, *_):
        call("umount", self.folder)
        self.folder.rmdir()


def call(*command, cwd=None, codes=(0,)):
    done = subprocess.run([*map(str, command)], cwd=cwd, capture_output=True, text=True, timeout=120)
    assert done.returncode in codes, done
    return done


def stickslip(folder, text, codes=(0,)):
    return call(PROGRAM, *text.split(), cwd=folder, codes=codes)


def write_sweep(folder, seeds):
    (folder / "crash.toml").write_text(SWEEP.format(seeds=seeds))


def nothing(folder):
    write_sweep(folder, 30)


def shorter(folder):
    write_sweep(folder, 20)
    stickslip(folder, "run crash.toml --out out --no-reduce")
    write_sweep(folder, 30)


def damaged(folder):
    shorter(folder)
    stickslip(folder, "run crash.toml --out out --no-reduce")
    for part in sorted((folder / "out/tables/slips").iterdir())[::4]:
        part.write_bytes(part.read_bytes()[:-9])


# What is there before, and what is then done at once. It is done again until there are enough images.
RUN = "run crash.toml --out out --no-reduce --threads 1"
KINDS = {
    "run": (nothing, [RUN]),
    "share": (nothing, [RUN, RUN]),
    "extend": (shorter, [RUN]),
    "repair": (damaged, ["verify out --repair"]),
}


def tables(folder):
    return {path.relative_to(folder): path.read_bytes() for path in (folder / "out/tables").rglob("*.parquet")}


def committed(folder):
    """Parts that the logs say are committed."""
    lines = [line for log in (folder / "out/run/log").glob("*.jsonl") for line in log.read_text().splitlines()]
    events = [json.loads(line) for line in lines if line.endswith("}")]
    return {event["part"] for event in events if event["event"] == "part_committed"}


def copy_image(image, copy, processes):
    """Copies an image while the processes are halted; whether the kernel has left it alone meanwhile."""
    for process in processes:
        process.send_signal(signal.SIGSTOP)
    try:
        shutil.copyfile(image, copy)
        return copy.read_bytes() == image.read_bytes()
    finally:
        for process in processes:
            process.send_signal(signal.SIGCONT)


@pytest.mark.parametrize("kind", KINDS)
def test_a_power_cut_loses_nothing_that_was_committed(kind, tmp_path):
    prepare, commands = KINDS[kind]
    first = tmp_path / "first"
    with first.open("wb") as file:
        file.truncate(SIZE)
    call("mkfs.ext4", "-q", "-F", first)
    with Disk(first, tmp_path / "mount") as folder:
        prepare(folder)
        local = Path(shutil.copytree(folder, tmp_path / "local", ignore=shutil.ignore_patterns("lost+found")))
    stickslip(local, commands[0], codes=(0, 3))
    stickslip(local, RUN)
    expected = tables(local)

    images, rounds = [], 0
    while len(images) < IMAGES:
        rounds += 1
        assert rounds < 20 * IMAGES, f"{len(images)} images"
        image = tmp_path / "image"
        shutil.copyfile(first, image)
        with Disk(image, tmp_path / "mount") as folder:
            options = {"cwd": folder, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            processes = [subprocess.Popen([PROGRAM, *command.split()], **options) for command in commands]
            time.sleep(0.002 * rounds)
            while len(images) < IMAGES and any(process.poll() is None for process in processes):
                living = [process for process in processes if process.poll() is None]
                copy = tmp_path / f"image-{len(images)}"
                parts = committed(folder)
                if copy_image(image, copy, living):
                    images.append((copy, parts))
                time.sleep(0.01 + 0.003 * (len(images) % 7))
            for process in processes:
                process.kill()
                process.wait()
        image.unlink()

    assert any(parts for _, parts in images), "no image is of a time when a part was committed"
    for number, (image, parts) in enumerate(images):
        with Disk(image, tmp_path / "mount") as folder:
            case = f"{kind}, image {number}"
            begun = (folder / "out/run/extension-000.json").exists()
            if begun and kind != "repair":
                stickslip(folder, "verify out", codes=(0, 3))
            if kind != "repair":
                there = {path.stem for path in (folder / "out/tables/jobs").glob("*")}
                assert parts <= there, f"{case}: {parts - there} are lost"
            if kind == "repair":
                stickslip(folder, "verify out --repair", codes=(0, 3, 4))
            stickslip(folder, RUN)
            assert tables(folder) == expected, case
        image.unlink()
    print(f"{kind}: {len(images)} images")
