"""A user-mode-linux guest with an NFS server and three hosts, h1 to h3, that mount it as /mnt/4.2 and as /mnt/3."""

import itertools
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest
from hosts import wait_until

VERSIONS = ("4.2", "3")
HOSTS = ("h1", "h2", "h3")


@dataclass
class Command:
    files: Path

    def status(self):
        """Its exit status; none while it runs."""
        file = self.files.with_suffix(".status")
        return int(file.read_text()) if file.exists() else None

    def output(self):
        """What it printed so far."""
        file = self.files.with_suffix(".out")
        return file.read_text() if file.exists() else ""

    def wait(self, seconds=60, expected=0):
        """Waits until it ends with this status, and returns what it printed."""
        wait_until(lambda: self.status() is not None, seconds, lambda: f"the command ends\n{self.output()}")
        assert self.status() == expected, self.output()
        return self.output()


class Guest:
    """The running guest. Its folder is /run/sandbox there, and the server's disk /mnt/disk."""

    def __init__(self, folder: Path, packages: Path):
        self.folder = folder
        self.ids = itertools.count(1)
        disk, console = folder / "disk", folder / "console"
        with disk.open("wb") as file:
            file.truncate(512 << 20)
        subprocess.run(["/sbin/mkfs.ext4", "-q", "-F", disk], check=True)
        shutil.copy(Path(__file__).with_name("nfs-guest"), folder / "init")
        linux = [packages / "usr/bin/linux.uml", "mem=1G", "root=/dev/root", "rootfstype=hostfs", "rootflags=/", "ro"]
        linux += [f"ubda={disk}", f"init={folder}/init", "con=null", "con0=fd:0,fd:1", "quiet", f"uml_dir={folder}/uml"]
        self.process = subprocess.Popen(
            [*linux, f"SANDBOX={folder}", f"PACKAGES={packages}"],
            stdin=subprocess.PIPE,
            stdout=console.open("wb"),
            stderr=subprocess.STDOUT,
            text=True,
            env=os.environ | {"TMPDIR": str(folder)},
        )
        wait_until(lambda: (folder / "mounts").exists() or self.process.poll() is not None, 240, "the guest is up")
        said = console.read_text(errors="replace")
        # Linux 6.1 as a guest has no room for the state of processors with AMX, and dies at its first program.
        if self.process.poll() is not None and "ptrace set fp regs failed" in said:
            pytest.skip("user-mode-linux does not run on this processor: its registers do not fit")
        assert self.process.poll() is None, said

    def start(self, host, command):
        """Starts a command of the shell on a host of the guest, or on the server."""
        name = str(next(self.ids))
        self.process.stdin.write(f"{host} {name} {command}\n")
        self.process.stdin.flush()
        return Command(self.folder / name)

    def run(self, host, command):
        """Runs a command on a host of the guest, which must succeed, and returns what it prints."""
        return self.start(host, command).wait()

    def fetch(self, name, folders="."):
        """Copies a folder of the server's disk, or some folders in it, out of the guest; where it is."""
        to = f"/run/sandbox/{name}"
        # Files that vanish meanwhile are claims or staged ones.
        self.run("server", f"rm -rf {to}; mkdir {to}; cd /mnt/disk/{name} && cp -r --parents {folders} {to}/ || true")
        return self.folder / name

    def power_off(self):
        self.process.kill()
        self.process.wait()
