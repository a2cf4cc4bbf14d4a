import {
  Color,
  Group,
  MeshLambertMaterial,
  Vector3,
  type WebGLProgramParametersWithUniforms,
} from "three";
import type { Colours } from "../theme";
import { blockMesh, smoothMesh } from "./meshes";
import type { Surface } from "./surface";

const CONTOURS = 12; // wished between the lowest and the highest place
const LEAST_RANGE = 0.002; // m    of heights: flatter ground has no contours
const LOOKS: Record<string, readonly [number, number, number]> = {
  soil: [1, 0, 0],
  slippery: [0, 1, 0],
  patch: [0, 0, 1],
};

const VERTEX = `
attribute vec3 look;
varying vec3 vLook;
varying vec3 vPlace;
varying float vUp;
`;
const PLACE = `
vLook = look;
vUp = normal.z;
#ifdef USE_INSTANCING
vPlace = (instanceMatrix * vec4(position, 1.0)).xyz;
#else
vPlace = position;
#endif
`;
const FRAGMENT = `
uniform vec3 line;
uniform vec3 soil;
uniform vec3 slippery;
uniform vec3 patchColour;
uniform vec3 range; // least height, 1/range, distance of contours or 0
uniform float wall;
varying vec3 vLook;
varying vec3 vPlace;
varying float vUp;

// the share of line colour in a grid of lines with a width [m]
float meshOf(vec2 at, float period, float width) {
  vec2 off = abs(fract(at / period - 0.5) - 0.5) * period;
  vec2 pixel = max(fwidth(at), 1e-6);
  vec2 on = 1.0 - smoothstep(0.5 * width - 0.5 * pixel, 0.5 * width + 0.5 * pixel, off);
  return max(on.x * min(width / pixel.x, 1.0), on.y * min(width / pixel.y, 1.0));
}

// the share of line colour in contours, half-way between multiples of their distance
float contour(float height, float apart) {
  float at = height / apart;
  float pixel = fwidth(at);
  float off = abs(fract(at) - 0.5);
  return (1.0 - smoothstep(0.6 * pixel, 1.5 * pixel, off)) * smoothstep(0.0, 0.002, pixel)
    * (1.0 - smoothstep(0.15, 0.45, pixel));
}
`;
const COLOUR = `
vec3 tone = diffuseColor.rgb * (1.0 - vLook.x - vLook.y - vLook.z)
  + soil * vLook.x + slippery * vLook.y + patchColour * vLook.z;
float level = clamp((vPlace.z - range.x) * range.y, 0.0, 1.0);
tone *= mix(0.82, 1.0, level);
if (vUp > 0.5) {
  tone = mix(tone, line, 0.55 * meshOf(vPlace.xy, 0.5, 0.006));
  tone = mix(tone, line, 0.3 * meshOf(vPlace.xy, 0.1, 0.0025));
  if (range.z > 0.0) tone = mix(tone, line, 0.8 * contour(vPlace.z, range.z));
} else {
  tone *= wall;
}
diffuseColor.rgb = tone;
`;

/** A surface as it is drawn: shaded, with contours, materials in colours of their own. */
export class Terrain extends Group {
  private readonly material = new MeshLambertMaterial();
  private readonly uniforms: Record<string, { value: unknown }> = {
    line: { value: new Color() },
    soil: { value: new Color() },
    slippery: { value: new Color() },
    patchColour: { value: new Color() },
    range: { value: new Vector3() },
    wall: { value: 1 },
  };

  /** height: of the surface's zero [m]. */
  constructor(surface: Surface, height: number) {
    super();
    const looks = (material: number) =>
      LOOKS[surface.materials[material - 1]?.look ?? ""] ?? ([0, 0, 0] as const);
    const mesh = (surface.smooth ? smoothMesh : blockMesh)(surface, looks, this.material);
    mesh.receiveShadow = true;
    mesh.castShadow = true;
    mesh.frustumCulled = false;
    this.add(mesh);
    const [low, high] = surface.range;
    this.uniforms.range.value = new Vector3(
      low,
      high > low ? 1 / (high - low) : 0,
      contourDistance(surface),
    );
    this.position.z = height;
    this.material.onBeforeCompile = (shader) => this.extend(shader);
  }

  paint(colours: Colours): void {
    this.material.color.copy(colours.floor);
    Object.assign(this.uniforms.line, { value: colours.contour });
    Object.assign(this.uniforms.soil, { value: colours.soil });
    Object.assign(this.uniforms.slippery, { value: colours.slippery });
    Object.assign(this.uniforms.patchColour, { value: colours.patch });
    Object.assign(this.uniforms.wall, { value: colours.dark ? 0.8 : 0.72 });
  }

  private extend(shader: WebGLProgramParametersWithUniforms): void {
    Object.assign(shader.uniforms, this.uniforms);
    shader.vertexShader = VERTEX.concat(shader.vertexShader).replace(
      "#include <begin_vertex>",
      `#include <begin_vertex>\n${PLACE}`,
    );
    shader.fragmentShader = FRAGMENT.concat(shader.fragmentShader).replace(
      "#include <color_fragment>",
      `#include <color_fragment>\n${COLOUR}`,
    );
  }
}

/** Returns the distance of contours [m]: 1, 2 or 5 times a power of ten; 0 without contours. */
function contourDistance(surface: Surface): number {
  const [low, high] = surface.range;
  if (!surface.smooth || high - low < LEAST_RANGE) return 0;
  const wished = (high - low) / CONTOURS;
  const power = 10 ** Math.floor(Math.log10(wished));
  return power * ([1, 2, 5].find((times) => times * power >= wished) ?? 10);
}
