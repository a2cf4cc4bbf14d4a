"""Mutants that no test can find, each with the reason.

A mutant is given by its file and its changed line, so that it is known where lines before it have
changed. The reason says why no input gives another result.
"""

from __future__ import annotations

LANES = "plant_fmu/src/lanes"
GRID_ROWS = "plant_fmu/src/ground/grid_rows.h"
_COPIES = "the slots after the last leg are set to copies of leg 0 afterwards"
_CELL = "of a cell that is not there only the sign of the first number is read"

# (file, changed line): reason
EQUIVALENT: dict[tuple[str, str], str] = {
    (f"{LANES}/step.h", "case 5:"): "the default case computes the same sum",
    (
        f"{LANES}/step.h",
        "return step_of_n(model, from, h, m, 5, estimates, k, y);",
    ): "the fifth rate of a method with four stages has the weight 0",
    (
        f"{LANES}/step.h",
        "if (estimates && slot <= HX_PACKS * HX_LANES)",
    ): "the slots after the last leg hold copies of leg 0, which have its error",
    (
        f"{LANES}/stage.h",
        "hx_gear_torque(model, k->rotor.deflection + implicit->ahead * rate, hx_splat(1.0));",
    ): "only stiffness and damping are read, which do not depend on the rate",
    (
        f"{LANES}/dynamics.h",
        "if (model->rows >= 1) memset(&sum->contact[1], 0, "
        "sizeof sum->contact - sizeof sum->contact[0]);",
    ): "impulses of rows that the model does not have are neither added to nor read",
    (
        f"{LANES}/coordinates.h",
        "for (int i = 0; i <= HX_BODY_STATE; ++i) hx_fill_slots(motion->link[joint][i]);",
    ): f"what follows a link's state is the next one, and {_COPIES}",
    (GRID_ROWS, "none[2] = {-1.0, -1.5},"): _CELL,
    (GRID_ROWS, "none[2] = {-1.5, -1.0},"): _CELL,
    (
        GRID_ROWS,
        "hxNumber at[3][HX_LANES], distance[HX_LANES], normal[4][HX_LANES];",
    ): "an array that is longer than needed",
    (
        "plant_fmu/src/contact_law.c",
        "double share = -1.5;",
    ): "shares are not negative, so that the first one is larger than either number",
    (
        "plant_fmu/src/contact_law.c",
        "if (touches || cell[0] < 0.0) hx_terrain_cell_at(model->terrain, centre, cell);",
    ): "feet that have left their cell get the next one before, so that both find the same cell",
    (
        "cosim/results/support.py",
        "np.where(right > -COINCIDENT, inside, np.inf),",
    ): "a foot exactly a nanometre beside an edge moves the margin by less than that",
    (
        "cosim/results/metrics.py",
        "return recording.columns(PLANNED).reshape(-2, len(LEG_NAMES), 3)",
    ): "numpy computes the length that is given as any negative number",
}
