"""Reads a conda recipe with py-rattler-build and renders it: `make test-metadata`.

py-rattler-build is no dependency of the project; the target has an environment of its own.
"""

from __future__ import annotations

import importlib
import sys


def main() -> None:
    """Prints what the recipe renders to; a wrong key or value ends with an error."""
    rattler_build = importlib.import_module("rattler_build")
    variants = rattler_build.VariantConfig({"c_compiler": ["gcc"], "python": ["3.12.*"]})
    for path in sys.argv[1:]:
        for variant in rattler_build.Stage0Recipe.from_file(path).render(variants):
            print(f"{path}: {variant.recipe}")


if __name__ == "__main__":
    main()
