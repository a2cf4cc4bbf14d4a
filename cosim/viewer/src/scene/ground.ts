import {
  CanvasTexture,
  Group,
  Mesh,
  MeshLambertMaterial,
  PlaneGeometry,
  Quaternion,
  RepeatWrapping,
  SRGBColorSpace,
  Vector3,
} from "three";
import type { Colours } from "../theme";
import { planeNormal, type Relief } from "./surface";

const SIZE = 24; // m    of the drawn plane; fog hides its edge
const TILE = 0.5; // m    of the grid's texture
const CELLS = 5; // per tile: lines every 10 cm
const PIXELS = 512; // of the grid's texture

/** The plane that the robot walks on, with a 10 cm grid; it follows the robot by whole tiles. */
export class Floor extends Group {
  private readonly plane: Mesh<PlaneGeometry, MeshLambertMaterial>;

  constructor(private readonly relief: Relief) {
    super();
    this.plane = new Mesh(new PlaneGeometry(SIZE, SIZE), new MeshLambertMaterial());
    this.plane.receiveShadow = true;
    this.add(this.plane);
    this.quaternion.copy(
      new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), planeNormal(relief.plane)),
    );
    this.follow(0, 0);
  }

  /** Moves the plane so that its middle is near a position. */
  follow(x: number, y: number): void {
    const place = new Vector3(x, y, this.relief.height(x, y));
    const origin = new Vector3(0, 0, this.relief.plane.height);
    const along = place.sub(origin).applyQuaternion(this.quaternion.clone().invert());
    const snapped = new Vector3(
      Math.round(along.x / TILE) * TILE,
      Math.round(along.y / TILE) * TILE,
      0,
    );
    this.position.copy(snapped.applyQuaternion(this.quaternion).add(origin));
  }

  paint({ floor, grid }: Colours): void {
    this.plane.material.map?.dispose();
    this.plane.material.map = gridTexture(`#${floor.getHexString()}`, `#${grid.getHexString()}`);
    this.plane.material.needsUpdate = true;
  }
}

function gridTexture(surface: string, line: string): CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = PIXELS;
  const context = canvas.getContext("2d")!;
  context.fillStyle = surface;
  context.fillRect(0, 0, PIXELS, PIXELS);
  context.strokeStyle = line;
  for (let k = 0; k <= CELLS; k++) {
    const at = (k * PIXELS) / CELLS;
    context.lineWidth = k % CELLS === 0 ? 7 : 2.5;
    context.globalAlpha = k % CELLS === 0 ? 1 : 0.7;
    context.beginPath();
    context.moveTo(at, 0);
    context.lineTo(at, PIXELS);
    context.moveTo(0, at);
    context.lineTo(PIXELS, at);
    context.stroke();
  }
  const texture = new CanvasTexture(canvas);
  texture.wrapS = texture.wrapT = RepeatWrapping;
  texture.repeat.set(SIZE / TILE, SIZE / TILE);
  texture.anisotropy = 8;
  texture.colorSpace = SRGBColorSpace;
  return texture;
}
