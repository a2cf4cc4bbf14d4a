"""What this extension adds to the command line."""

from hexapod_cosim.cosim.cli.extension import Command, Extension

PACKAGE = "hexapod_cosim.extensions.live"
LIVE = Command(
    name="live",
    about="Drive the robot in a browser, in real time.",
    place=f"{PACKAGE}.commands:live",
)
REALTIME = Command(
    name="realtime",
    about="Measure how long the plant takes for a step.",
    place=f"{PACKAGE}.commands:realtime",
)
EXTENSION = Extension(
    commands=[LIVE, REALTIME],
    release={"browser/robot.wasm": f"{PACKAGE}.static_page:robot_module"},
    site={"walk.html": f"{PACKAGE}.static_page:write_static_page"},
)
