"""Runs the notebooks, side by side, and leaves them with what they put out."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import nbformat
from nbclient import NotebookClient

TIMEOUT = 300  # s, for one cell: beyond it something hangs


def run(path: Path) -> float:
    """Runs one and writes its results into it; the time it took [s]. Raises what a cell raised."""
    began = time.monotonic()
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(
        notebook,
        timeout=TIMEOUT,
        kernel_name="python3",
        resources={"metadata": {"path": str(path.parent)}},
    )
    client.execute()
    nbformat.write(notebook, path)
    return time.monotonic() - began


@contextmanager
def running(folder: Path) -> Iterator[None]:
    """Runs all of a folder while the block does something else, and prints how long each took."""
    paths = sorted(folder.glob("*.ipynb"))
    with ThreadPoolExecutor(max_workers=min(len(paths), os.cpu_count() or 1)) as pool:
        times = [pool.submit(run, path) for path in paths]
        yield
        for path, seconds in zip(paths, times, strict=True):
            print(f"{path.name}: {seconds.result():.0f} s")
