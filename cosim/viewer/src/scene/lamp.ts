import type { DirectionalLight } from "three";

/** Lets a lamp cast soft shadows within a reach [m] of its target, on a map of so many texels. */
export function castShadows(lamp: DirectionalLight, reach: number, texels: number): void {
  const { shadow } = lamp;
  lamp.castShadow = true;
  shadow.mapSize.set(texels, texels);
  Object.assign(shadow, { radius: 4, intensity: 0.6, normalBias: 0.004 });
  const sides = { left: -reach, right: reach, top: reach, bottom: -reach };
  Object.assign(shadow.camera, { ...sides, near: 0.5, far: 6 });
}
