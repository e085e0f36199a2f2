"""Hosts that mount a disk over NFS 4.2, or 3 without locks, share a sweep."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from nfs import HOSTS, VERSIONS, Guest
from hosts import wait_until
from sharing import PARTS, abandoned, assert_each_part_ran_once, assert_same, committed, done_parts, write_sweep

# System calls of the guest are some 20 times slower than this machine's: one block, and slips for some 15 s of CPU time.
TRIVIAL, SLIPS = 1, 6000


@pytest.fixture(scope="module")
def guest(program, tmp_path_factory):
    folder = tmp_path_factory.mktemp("nfs")
    shutil.copy(program, folder / "stickslip")
    write_sweep(folder / "shared.toml", TRIVIAL, SLIPS)
    guest = Guest(folder, Path(os.environ["UML_PACKAGES"]))
    yield guest
    guest.power_off()


def test_three_hosts_mount_both_versions(guest):
    mounts = (guest.folder / "mounts").read_text()
    assert " /mnt/4.2 nfs4 " in mounts and "vers=4.2" in mounts
    assert " /mnt/3 nfs " in mounts and "vers=3" in mounts and "local_lock=all" in mounts


def test_a_lock_on_nfs_3_is_seen_on_its_own_mount_alone(guest):
    guest.run("server", "touch /mnt/disk/lock; chmod 666 /mnt/disk/lock")

    def is_seen(holder, mount, other, its):
        held = guest.start(holder, f"flock --nonblock {mount}/lock bash -c 'echo held; sleep 5'")
        wait_until(lambda: "held" in held.output(), 60, "the lock is held")
        taken = guest.start(other, f"flock --nonblock {its}/lock true")
        wait_until(lambda: taken.status() is not None, 60, "the other has tried")
        held.wait()
        return taken.status() != 0

    assert is_seen("h1", "/mnt/3", "h1", "/mnt/3") and is_seen("h1", "/mnt/4.2", "h2", "/mnt/4.2")
    others = [("h1", "/mnt/3", "h2", "/mnt/3"), ("h1", "/mnt/3", "h1", "/mnt/4.2")]
    assert not any(is_seen(*pair) for pair in [*others, ("server", "/mnt/disk", "h1", "/mnt/3")])


def start(guest, host, version, name):
    """Starts a run of the sweep on a host; its process id goes to a file."""
    program = "/run/sandbox/stickslip run /run/sandbox/shared.toml"
    pid = f"/run/sandbox/{name}-{host}.pid"
    # A worker ends with 0 also where another host still runs the last part.
    out = f"--out /mnt/{version}/{name} --threads 1 --worker"
    return guest.start(host, f"echo $$ > {pid}; exec {program} {out}")


@pytest.mark.parametrize("version", VERSIONS)
def test_three_hosts_share_a_sweep_and_run_each_part_once(guest, local_run, version):
    name = f"together-{version}"
    for command in [start(guest, host, version, name) for host in HOSTS]:
        command.wait(300)
    results = guest.fetch(name)
    assert_each_part_ran_once(results, workers=len(HOSTS))
    assert_same(results, local_run(SLIPS, TRIVIAL))


@pytest.mark.parametrize("version", VERSIONS)
def test_three_hosts_that_know_a_directory_extend_it_at_once(guest, program, version):
    name, few = f"extended-{version}", 400
    whole = write_sweep(guest.folder / "shared.toml", TRIVIAL, few).read_text()
    half = whole.replace("count = 64", "count = 32")
    assert half != whole
    (guest.folder / "half.toml").write_text(half)
    # Each host remembers that there was one extension, and no other.
    for host in HOSTS:
        guest.run(host, f"/run/sandbox/stickslip run /run/sandbox/half.toml --out /mnt/{version}/{name} --no-reduce")
    try:
        for command in [start(guest, host, version, name) for host in HOSTS]:
            command.wait(300)
    finally:
        write_sweep(guest.folder / "shared.toml", TRIVIAL, SLIPS)
    results = guest.fetch(name)
    assert_each_part_ran_once(results, workers=2)
    local = guest.folder / f"local-{version}"
    for sweep in [half, whole]:
        (guest.folder / "local.toml").write_text(sweep)
        subprocess.run([program, "run", guest.folder / "local.toml", "--out", local], check=True, capture_output=True)
    assert_same(results, local)


def test_the_parts_of_a_killed_process_are_taken_over_by_another_host(guest, local_run):
    # Both versions at once: a silent process of another host counts as dead after a minute.
    names = {version: f"killed-{version}" for version in VERSIONS}
    runs = {(host, version): start(guest, host, version, names[version]) for host in HOSTS for version in VERSIONS}
    left = list(names.values())

    def kill_where_all_have_done_a_part():
        for name in list(left):
            results = guest.fetch(name, "run/claims tables/jobs")
            if all(committed(results, host) for host in HOSTS) and abandoned(results, "h2"):
                guest.run("h2", f"kill -9 $(cat /run/sandbox/{name}-h2.pid)")
                assert abandoned(guest.fetch(name, "run/claims tables/jobs"), "h2")
                left.remove(name)
        return not left

    wait_until(kill_where_all_have_done_a_part, 180, "each host has done a part")
    for (host, version), run in runs.items():
        run.wait(300, expected=137 if host == "h2" else 0)
    for version, name in names.items():

        def is_whole():
            # On a fast machine the others end while the killed one may still live; a later worker takes its parts over.
            start(guest, "h1", version, name).wait(300)
            return done_parts(guest.fetch(name, "tables/jobs")) == PARTS

        wait_until(is_whole, 180, "the parts of the killed process are done")
        results = guest.fetch(name)
        assert_each_part_ran_once(results, workers=len(HOSTS), killed=1)
        assert_same(results, local_run(SLIPS, TRIVIAL))
