import type { Recording } from "../recording";
import type { Relief } from "../scene/relief";
import type { PackedRun } from "../types";

/** A run of the report with its unpacked recording. */
export interface Run {
  readonly run: PackedRun;
  readonly recording: Recording;
  readonly relief: Relief;
}

/** Returns the element of the page that holds the plots of a section. */
export function hostOf(section: string): HTMLElement | null {
  return document.querySelector<HTMLElement>(`[data-panels="${section}"]`);
}
