"""Runs the notebooks in parallel and writes their outputs into them."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import nbformat
from nbclient import NotebookClient

TIMEOUT = 300  # s    limit for one cell


def run(path: Path) -> float:
    """Runs a notebook and writes its outputs into it; returns the time [s].

    Raises the exception of a cell that fails.
    """
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
    """Runs all notebooks of a folder during the block, then prints their times."""
    paths = sorted(folder.glob("*.ipynb"))
    with ThreadPoolExecutor(max_workers=min(len(paths), os.cpu_count() or 1)) as pool:
        times = [pool.submit(run, path) for path in paths]
        yield
        for path, seconds in zip(paths, times, strict=True):
            print(f"{path.name}: {seconds.result():.0f} s")
