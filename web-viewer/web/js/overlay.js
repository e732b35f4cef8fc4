// What lies over the picture: a layer of SVG for lines and one of HTML for labels and pins, both following the camera.
//
// A layer's members are told to place themselves after every picture; `project` gives them their places.

export const OVERLAY_STYLE = `
  .over { position: absolute; inset: 0; overflow: hidden; pointer-events: none; font: 0.875rem/1.4 system-ui, sans-serif; }
  .over svg { position: absolute; inset: 0; width: 100%; height: 100%; }
  .line { stroke: #fff; stroke-width: 2; paint-order: stroke; filter: drop-shadow(0 0 1.5px #000); }
  .end { fill: #e0aa62; stroke: #221a10; stroke-width: 1.5; }
  .cross { stroke: #fff; stroke-width: 1.5; fill: none; filter: drop-shadow(0 0 1.5px #000); display: none; }
  :host(:focus-visible) .over.aiming .cross { display: inline; }
  .over.aiming + .aim { display: block; }
  .tag { position: absolute; left: 0; top: 0; padding: 0.1rem 0.5rem; border-radius: 0.35rem; white-space: nowrap;
    color: #f4f2ee; background: #17181be0; font-variant-numeric: tabular-nums; }
  .pin { position: absolute; left: 0; top: 0; width: 1.75rem; height: 1.75rem; margin: -0.875rem 0 0 -0.875rem; padding: 0;
    border: 2px solid #221a10; border-radius: 50%; background: #e0aa62; color: #221a10; font: 600 0.8rem/1 system-ui, sans-serif;
    cursor: pointer; pointer-events: auto; }
  .pin.behind { opacity: 0.3; }
  .pin:hover { background: #f0c285; }
  .pin:focus-visible { outline: 3px solid #fff; outline-offset: 1px; }
  .note { position: absolute; left: 0; top: 0; box-sizing: border-box; width: max-content; max-width: min(18rem, calc(100% - 1rem));
    padding: 0.5rem 0.75rem; border-radius: 0.5rem; color: #f4f2ee; background: #17181bf0; overflow-wrap: anywhere;
    white-space: pre-line; }
  .note strong { display: block; font-size: inherit; }
  .said { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); }
  [hidden] { display: none !important; }
`;

const SVG = "http://www.w3.org/2000/svg";

/** An SVG element. */
export function svg(name, className) {
  const element = document.createElementNS(SVG, name);
  element.setAttribute("class", className);
  return element;
}

/** An HTML element. */
export function html(name, className) {
  const element = document.createElement(name);
  element.className = className;
  return element;
}

/** Moves `element` so that its upper left corner is at a place of the layer. */
export function moveTo(element, x, y) {
  element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
}

/** The layer of one viewer. `project(point)` gives a point's place in CSS pixels of the layer, or null. */
export class Overlay {
  element = html("div", "over");
  lines = svg("svg", "lines");
  project;
  #members = [];
  #said = html("div", "said");

  constructor(project) {
    this.project = project;
    this.lines.setAttribute("aria-hidden", "true");
    this.#said.setAttribute("role", "status");
    this.element.append(this.lines, this.#said);
  }

  /** `member.place(overlay)` is called after every picture; true asks for another call soon. */
  add(member) {
    this.#members.push(member);
  }

  place() {
    return this.#members.map((member) => member.place(this)).some(Boolean);
  }

  /** Tells screen readers. */
  say(text) {
    this.#said.textContent = text;
  }
}
