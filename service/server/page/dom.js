// Elements made and kept up to date without markup from data: texts are always text nodes.

const SVG = "http://www.w3.org/2000/svg";
const SVG_NAMES = new Set(["svg", "path", "line", "rect", "circle", "g", "text", "polyline", "polygon", "title"]);

/** An element with attributes, listeners (`onclick`) and children; what is null or undefined is left out. */
export const element = (name, attributes = {}, ...children) => {
  const made = SVG_NAMES.has(name) ? document.createElementNS(SVG, name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else made.setAttribute(key, value === true ? "" : String(value));
  }
  made.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return made;
};

/** What the service says in a sentence, as findings and errors do: it is in English, whatever the language of the page. */
export const inEnglish = (text) => element("span", { lang: "en" }, text);

/** Sets lines of text, each a list of texts and elements, where they have changed. */
export const setLines = (node, lines) => {
  const made = element("div", {}, ...lines.flatMap((line, index) => [index > 0 ? "\n" : "", ...line]));
  if (node.textContent !== made.textContent || node.childElementCount !== made.childElementCount) node.replaceChildren(...made.childNodes);
};

/** Sets a text where it has changed. */
export const setText = (node, text) => {
  if (node.textContent !== text) node.textContent = text;
};

/** Sets an attribute where it has changed; null takes it away. */
export const setAttribute = (node, name, value) => {
  if (value === null || value === undefined || value === false) {
    if (node.hasAttribute(name)) node.removeAttribute(name);
  } else if (node.getAttribute(name) !== String(value)) {
    node.setAttribute(name, String(value));
  }
};

/**
 * Keeps the children of a node in step with a list: one child for each key, made once, updated each time, in the order of
 * the list. Focus stays where it is.
 */
export const keep = (parent, list, keyOf, make, update) => {
  const known = new Map([...parent.children].map((child) => [child.dataset.key, child]));
  let previous = null;
  for (const entry of list) {
    const key = String(keyOf(entry));
    let child = known.get(key);
    known.delete(key);
    if (!child) {
      child = make(entry);
      child.dataset.key = key;
    }
    const expected = previous ? previous.nextSibling : parent.firstChild;
    if (child !== expected) parent.insertBefore(child, expected);
    update(child, entry);
    previous = child;
  }
  for (const child of known.values()) child.remove();
};
