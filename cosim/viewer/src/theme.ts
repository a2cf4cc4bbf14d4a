import { Color } from "three";

/** Custom properties of the page's style sheet with the colours that the 3D view needs. */
const NAMES = [
  ...(["sky", "floor", "grid", "force", "contact", "contour"] as const),
  ...(["soil", "slippery", "patch"] as const),
];

export type Colours = Readonly<Record<(typeof NAMES)[number], Color>> & { readonly dark: boolean };

/** Returns a custom property of the page, such as --ink. */
export function property(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

export function readColours(): Colours {
  const colours = NAMES.map((name) => [name, new Color(property(`--${name}`))]);
  return { ...Object.fromEntries(colours), dark: isDark() } as Colours;
}

export function isDark(): boolean {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
}

/** The light or dark theme: the system's, or the reader's choice for this page. */
export class Theme {
  private readonly listeners: (() => void)[] = [];

  constructor(button: HTMLButtonElement | null) {
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.notify());
    button?.addEventListener("click", () => this.toggle());
  }

  listen(listener: () => void): void {
    this.listeners.push(listener);
  }

  toggle(): void {
    const theme = isDark() ? "light" : "dark";
    document.documentElement.dataset.theme = theme;
    this.notify();
  }

  private notify(): void {
    for (const listener of this.listeners) listener();
  }
}

/** Returns the style of a plot's axis, in the page's present colours whenever it is drawn. */
export function quietAxis() {
  return {
    stroke: () => property("--muted"),
    grid: { stroke: () => property("--line"), width: 1 },
    ticks: { show: false },
    font: "11px system-ui",
  };
}
