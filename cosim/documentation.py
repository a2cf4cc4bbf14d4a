"""documentation/index.html inside an FMU: what an importer's user needs to know, on one page."""

from __future__ import annotations

from html import escape

from hexapod_cosim.cosim.interface import Interface

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{name}: hexapod plant</title>
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; }}
table {{ border-collapse: collapse; }}
td, th {{ text-align: left; vertical-align: top; padding: 0.2em 0.8em 0.2em 0; border-bottom: 1px solid #8884; }}
</style>
</head>
<body>
<h1>{name}: hexapod plant</h1>
<p>A six-legged robot of {bodies} rigid bodies and {joints} servo joints ({mass:.3f} kg) on compliant ground: FMI 2.0 co-simulation
and model exchange, version {version}, GUID {guid}.</p>
<h2>First run</h2>
<p>Without any input the robot stands in its pose, settled on the ground, and stays there. Drive it by the joint commands
<code>L.J.angle_ref</code>, <code>L.J.speed_ref</code> and <code>L.J.torque_ref</code>; push it by <code>torso.push_force</code>.
Inputs are held over a communication step ({step} s suits walking).</p>
<h2>Conventions</h2>
<ul>
<li>SI units, radians. World z points up; vectors are in world axes unless their description says otherwise.</li>
<li>Legs LF LM LR RF RM RR (left and right, front, middle and rear; left is +y), joints coxa, femur, tibia.</li>
<li>Quaternions are w x y z, body to world. Inertias are about the centre of mass.</li>
</ul>
<h2>Setting and stepping</h2>
<ul>
<li>Parameters are fixed: set them before initialisation ends. Values out of range, infinite or NaN are refused, and of the batch they
came in nothing is set.</li>
<li>Accuracy is the parameter <code>solver.tolerance</code> (or <code>solver.step</code>); the experiment's tolerance does not change it,
so results do not depend on the importer's settings.</li>
<li>A step that the plant cannot take is discarded and leaves the state as it was. The state can be saved, restored and serialised.</li>
<li>Model exchange: {states} continuous states (torso, joint angles and speeds, works, bristles); events are touch-downs and lift-offs.</li>
<li>Directional derivatives of outputs and state derivatives by inputs and states are exact. Derivatives of inputs and outputs are of
order 1; a derivative of an input holds for the next step.</li>
<li>Not provided: asynchronous steps.</li>
</ul>
<h2>Variables</h2>
<p>{{leg}} and {{joint}} stand for the names above, [i] for 1, 2, 3 (quaternions: to 4).</p>
<table>
<tr><th>name</th><th>causality</th><th>unit or type</th><th>meaning</th></tr>
{rows}
</table>
<h2>Where the robot's numbers come from</h2>
<ul>
{sources}
</ul>
<p>MIT licence.</p>
</body>
</html>
"""


def render_html(interface: Interface, guid: str) -> str:
    """The page for one robot's FMU."""
    rows = [
        f"<tr><td><code>{escape(pattern.name)}</code></td><td>{pattern.causality}</td>"
        f"<td>{escape(pattern.kind)}</td><td>{escape(pattern.description)}</td></tr>"
        for pattern in interface.patterns
    ]
    sources = [f"<li>{escape(key)}: {escape(text)}</li>" for key, text in sorted(interface.robot.source.items())]
    joints = sum(len(leg.links) for leg in interface.robot.legs)
    return PAGE.format(
        name=escape(interface.robot.name),
        bodies=1 + joints,
        joints=joints,
        mass=interface.robot.total_mass,
        version=interface.version,
        guid=guid,
        step=interface.step,
        states=len(interface.states),
        rows="\n".join(rows),
        sources="\n".join(sources) or "<li>not stated</li>",
    )
