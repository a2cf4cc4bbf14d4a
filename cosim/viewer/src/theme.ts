import { Color } from "three";

/** The colours of the page's style sheet that the 3D view needs. */
export interface Colours {
  readonly dark: boolean;
  readonly sky: Color;
  readonly floor: Color;
  readonly grid: Color;
  readonly force: Color;
  readonly print: Color;
  readonly contour: Color;
  readonly edge: Color;
  readonly soil: Color;
  readonly slippery: Color;
  readonly patch: Color;
}

const KEY = "hexapod-report-theme";

/** Returns a custom property of the page, such as --ink. */
export function property(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

export function readColours(): Colours {
  const colour = (name: string) => new Color(property(name));
  return {
    dark: isDark(),
    sky: colour("--sky"),
    floor: colour("--floor"),
    grid: colour("--grid"),
    force: colour("--force"),
    print: colour("--print"),
    contour: colour("--contour"),
    edge: colour("--edge"),
    soil: colour("--soil"),
    slippery: colour("--slippery"),
    patch: colour("--patch"),
  };
}

export function isDark(): boolean {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
}

/** The light or dark theme: the system's, or the reader's choice, stored if the browser can. */
export class Theme {
  private readonly listeners: (() => void)[] = [];

  constructor(button: HTMLButtonElement | null) {
    const stored = storedTheme();
    if (stored) document.documentElement.dataset.theme = stored;
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.notify());
    button?.addEventListener("click", () => this.toggle());
  }

  listen(listener: () => void): void {
    this.listeners.push(listener);
  }

  toggle(): void {
    const theme = isDark() ? "light" : "dark";
    document.documentElement.dataset.theme = theme;
    try {
      localStorage.setItem(KEY, theme);
    } catch {
      // a page opened from disk may have no storage: the choice then lasts as long as the page
    }
    this.notify();
  }

  private notify(): void {
    for (const listener of this.listeners) listener();
  }
}

function storedTheme(): string | null {
  try {
    return localStorage.getItem(KEY);
  } catch {
    return null;
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
