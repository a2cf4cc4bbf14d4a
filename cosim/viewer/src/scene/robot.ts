import {
  type BufferGeometry,
  CapsuleGeometry,
  Color,
  Group,
  Mesh,
  MeshLambertMaterial,
  SphereGeometry,
  Vector3,
} from "three";
import { RoundedBoxGeometry } from "three/addons/geometries/RoundedBoxGeometry.js";
import { legPoints, type Pose, torsoOrigin, toVector3 } from "../kinematics";
import type { Robot } from "../types";

const UP = new Vector3(0, 1, 0); // axis of a capsule in three.js
const LIT = new Color("#ffd54a"); // colour of a foot on the ground
const DARK = new Color("#5b626c"); // colour of a foot in the air
const STRIPE = 0.16; // width of the mark in the control's colour, relative to the torso's

type Solid = Mesh<BufferGeometry, MeshLambertMaterial>;

/** The robot, drawn as capsules and a box; feet light up on the ground. Parts of a leg have its
 * index in `userData.leg`. */
export class RobotModel extends Group {
  private readonly torso = new Group();
  private readonly links: Mesh[][];
  private readonly feet: Solid[];

  constructor(
    private readonly robot: Robot,
    mark: Color,
  ) {
    super();
    this.add(this.torso);
    this.makeTorso(mark);
    this.links = robot.legs.map((_, leg) => this.makeLinks(leg));
    this.feet = robot.legs.map((_, leg) => this.makeFoot(leg));
  }

  /** Moves the robot into a pose; feet in contact light up. */
  place(pose: Pose, inContact: readonly boolean[]): void {
    this.torso.position.copy(torsoOrigin(this.robot, pose));
    this.torso.quaternion.copy(pose.attitude);
    this.links.forEach((links, leg) => {
      const points = legPoints(this.robot, pose, leg);
      links.forEach((link, joint) => {
        span(link, points[joint], points[joint + 1]);
      });
      const foot = this.feet[leg];
      foot.position.copy(points[3]);
      foot.material.color.copy(inContact[leg] ? LIT : DARK);
      foot.material.emissive.copy(LIT).multiplyScalar(inContact[leg] ? 0.55 : 0);
    });
  }

  private makeTorso(mark: Color): void {
    const [length, width, height] = this.robot.torso.size;
    const corner = 0.22 * Math.min(length, width, height);
    this.torso.add(
      solid(new RoundedBoxGeometry(length, width, height, 4, corner), this.robot.colours.torso),
    );
    const lid = solid(
      new RoundedBoxGeometry(0.72 * length, STRIPE * width, 0.14 * height, 3, 0.05 * height),
      "#ffffff",
    );
    lid.material.color.copy(mark);
    lid.position.set(0, 0, 0.5 * height);
    const nose = solid(
      new RoundedBoxGeometry(0.05 * length, 0.5 * width, 0.3 * height, 3, 0.05 * height),
      "#e8edf3",
    );
    nose.position.set(0.5 * length, 0, 0.12 * height);
    this.torso.add(lid, nose);
  }

  private makeLinks(leg: number): Mesh[] {
    const data = this.robot.legs[leg].links;
    const scale = toVector3(data[0].tip).length();
    return data.map((link, joint) => {
      const radius = this.robot.thickness[joint] * scale;
      const mesh = solid(
        new CapsuleGeometry(radius, toVector3(link.tip).length(), 8, 20),
        this.robot.colours[this.robot.joints[joint]],
      );
      mesh.userData.leg = leg;
      this.add(mesh);
      return mesh;
    });
  }

  private makeFoot(leg: number): Solid {
    const foot = solid(new SphereGeometry(this.robot.foot, 28, 18), "#ffffff");
    foot.userData.leg = leg;
    this.add(foot);
    return foot;
  }
}

function solid(geometry: BufferGeometry, colour: string): Solid {
  const mesh = new Mesh(geometry, new MeshLambertMaterial({ color: new Color(colour) }));
  mesh.castShadow = true;
  mesh.receiveShadow = true;
  return mesh;
}

function span(link: Mesh, from: Vector3, to: Vector3): void {
  link.position.copy(from).add(to).multiplyScalar(0.5);
  link.quaternion.setFromUnitVectors(UP, to.clone().sub(from).normalize());
}
