"""Installs the emulators of `make test-platforms` from Debian's or Ubuntu's packages: Wine,
Maven, qemu-user, an Arm C library.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

PACKAGES = {  # by a program or file of the package
    "wine": ["wine", "wine64"],
    "mvn": ["maven"],  # downloads the Python for Windows
    "qemu-aarch64": ["qemu-user"],
    "/usr/aarch64-linux-gnu/lib/libc.so.6": ["libc6-arm64-cross"],
}


def main() -> int:
    """Installs the missing packages; returns the exit code."""
    packages = [
        name
        for need, names in PACKAGES.items()
        if shutil.which(need) is None and not Path(need).exists()
        for name in names
    ]
    if not packages:
        return 0
    command = ["apt-get", "install", "--yes", "--no-install-recommends", *packages]
    if shutil.which("apt-get") is None or os.geteuid() != 0:
        expected = (
            "apt-get and the rights of root"
            if shutil.which("apt-get") is None
            else "the rights of root"
        )
        print(
            f"missing: {', '.join(packages)}; to install them this needs {expected}. As "
            f"root: {' '.join(command)}",
            file=sys.stderr,
        )
        return 1
    subprocess.run(["apt-get", "update", "--quiet"], check=False)
    return subprocess.run(
        command, check=False, env=os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    ).returncode


if __name__ == "__main__":
    sys.exit(main())
