"""Runs the campaign: `PYTHONPATH=tests/support python -m benchmarks.identification --help`."""

from benchmarks.identification.campaign import main

if __name__ == "__main__":
    raise SystemExit(main())
