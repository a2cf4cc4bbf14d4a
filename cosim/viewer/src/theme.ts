import { Color } from "three";

/** What the page's style sheet says of colours, as the 3D view needs them. */
export interface Colours {
  readonly dark: boolean;
  readonly sky: Color;
  readonly floor: Color;
  readonly grid: Color;
  readonly force: Color;
  readonly print: Color;
}

const KEY = "hexapod-report-theme";

/** A custom property of the page, such as --ink. */
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
  };
}

export function isDark(): boolean {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
}

/** Light and dark: the system's choice until the reader makes one, which is remembered where the browser allows it. */
export class Theme {
  private readonly listeners: (() => void)[] = [];

  constructor(button: HTMLButtonElement | null) {
    const kept = remembered();
    if (kept) document.documentElement.dataset.theme = kept;
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.tell());
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
      // a page from disk may have no storage: the choice then lasts as long as the page
    }
    this.tell();
  }

  private tell(): void {
    for (const listener of this.listeners) listener();
  }
}

function remembered(): string | null {
  try {
    return localStorage.getItem(KEY);
  } catch {
    return null;
  }
}
