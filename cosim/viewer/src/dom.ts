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

/** Returns a number as text with a true minus sign, and zero without any. */
export function fixed(value: number, digits: number): string {
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}
