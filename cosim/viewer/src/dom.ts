/** Returns a new element with a class and a text. */
export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  name = "",
  text = "",
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  if (name) made.className = name;
  if (text) made.textContent = text;
  return made;
}

/** Returns the page's element with an id, or null. */
export function byId<T extends HTMLElement>(id: string): T | null {
  return document.getElementById(id) as T | null;
}

/** Lets the page's buttons open and close its dialog of keys; returns what opens or closes it. */
export function listenToHelp(): () => void {
  const help = byId<HTMLDialogElement>("help");
  const toggle = () => (help?.open ? help.close() : help?.showModal());
  byId("help-button")?.addEventListener("click", toggle);
  byId("help-close")?.addEventListener("click", toggle);
  return toggle;
}

/** What a plot's heading shows of a curve. */
export interface Labelled {
  readonly label: string;
  /** Name of the page's custom property that holds the colour. */
  readonly colour: string;
  readonly dash?: readonly number[];
}

/** Adds a plot's figure to a host: its heading, the elements of its curves' values, and its box. */
export function makeFigure(
  host: HTMLElement,
  name: string,
  unit: string,
  curves: readonly Labelled[],
): { values: HTMLElement[]; box: HTMLElement } {
  const figure = element("figure", "panel");
  const heading = element("figcaption", "panel-title");
  const title = element("span", "panel-name", name);
  title.append(element("span", "panel-unit", ` ${unit}`));
  const readouts = element("div", "readouts"); // which wrap into a row of their own together
  const values = curves.map(({ label, colour, dash }) => {
    const item = element("span", "readout");
    const mark = element("i", dash ? "mark dashed" : "mark");
    mark.style.setProperty("--mark", `var(${colour})`);
    const value = element("b", "value");
    item.append(mark, element("span", "curve-name", label), value);
    readouts.append(item);
    return value;
  });
  const box = element("div", "panel-box");
  heading.append(title, readouts);
  figure.append(heading, box);
  host.append(figure);
  return { values, box };
}

/** Returns a number as text with a true minus sign, and zero without any. */
export function fixed(value: number, digits: number): string {
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}
