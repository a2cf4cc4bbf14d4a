"""Builds an FMU with direct feed-through (tests/native/feed_through.c), which replaces the
controller in packages.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import zipfile
from pathlib import Path

import fmpy

SOURCE = Path(__file__).parents[1] / "native" / "feed_through.c"
HEADERS = Path(fmpy.__file__).parent / "c-code"
JOINT, FOOT = "LF.coxa", "LF.foot"
DESCRIPTION = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="feed_through" guid="{{feed_through}}">
  <CoSimulation modelIdentifier="feed_through" canHandleVariableCommunicationStepSize="true"/>
  <UnitDefinitions>
    <Unit name="rad"><BaseUnit rad="1"/></Unit>
    <Unit name="rad0.5"/>
  </UnitDefinitions>
  <ModelVariables>
    <ScalarVariable name="{JOINT}.angle" valueReference="0" causality="input">
      <Real unit="rad" start="0.4"/>
    </ScalarVariable>
    <ScalarVariable name="start" valueReference="1" causality="parameter" variability="fixed">
      <Real unit="rad" start="0.4"/>
    </ScalarVariable>
    <ScalarVariable name="gain" valueReference="2" causality="parameter" variability="fixed">
      <Real unit="rad0.5" start="0.5"/>
    </ScalarVariable>
    <ScalarVariable name="swing" valueReference="3" causality="input">
      <Real unit="rad" start="0.05"/>
    </ScalarVariable>
    <ScalarVariable name="{JOINT}.angle_ref" valueReference="4" causality="output">
      <Real unit="rad"/>
    </ScalarVariable>
    <ScalarVariable name="{FOOT}.contact" valueReference="0" causality="input"
        variability="discrete">
      <Boolean start="true"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="5"/></Outputs>
    <InitialUnknowns><Unknown index="5"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""


def compiler() -> str:
    """Returns the C compiler."""
    return os.environ.get("CC") or next(
        found for name in ("cc", "gcc", "clang") if (found := shutil.which(name))
    )


def make_feed_through(folder: Path, platform: str) -> Path:
    """Compiles the FMU in a folder and returns its path."""
    library, fmu = folder / "feed_through.so", folder / "feed_through.fmu"
    command = [
        compiler(),
        "-shared",
        "-fPIC",
        str(SOURCE),
        "-I",
        str(HEADERS),
        "-lm",
        "-o",
        str(library),
    ]
    subprocess.run(command, check=True, capture_output=True)
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.write(library, f"binaries/{platform}/feed_through{library.suffix}")
    return fmu
