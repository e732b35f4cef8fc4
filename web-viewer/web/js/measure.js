// The distance between two points of the surface.
//
// It is exact for what was drawn when the points were picked; what is said after ± is the most that finer data could
// move both points, from the error bound of the nodes they were picked on.

import { html, moveTo, svg } from "./overlay.js";

/** Digits of a distance without a known error. */
const MOST_DIGITS = 12;

/** Picks two points, shows their distance. */
export class Measure {
  #overlay;
  #points = [];
  #line = svg("line", "line");
  #ends = [svg("circle", "end"), svg("circle", "end")];
  #cross = svg("path", "cross");
  #tag = html("div", "tag");
  #active = false;

  constructor(overlay) {
    this.#overlay = overlay;
    for (const end of this.#ends) end.setAttribute("r", "5");
    overlay.lines.append(this.#line, ...this.#ends, this.#cross);
    overlay.element.append(this.#tag);
    overlay.add(this);
    this.place();
  }

  /** Whether clicks pick points. */
  get active() {
    return this.#active;
  }

  set active(on) {
    this.#active = on;
    this.#overlay.element.classList.toggle("aiming", on);
    if (on) this.#overlay.say("Measuring: click two points, or aim with the arrow keys and press Enter. Escape ends it.");
    this.clear();
  }

  /** What was measured, or null: distance and error in the file's units, and both points. */
  get result() {
    const [a, b] = this.#points;
    if (!b) return null;
    return {
      distance: Math.hypot(...a.position.map((value, i) => value - b.position[i])),
      error: a.error + b.error,
      points: [a.position, b.position],
    };
  }

  /** Forgets the points; whether there were any. */
  clear() {
    const had = this.#points.length > 0;
    this.#points = [];
    this.place();
    return had;
  }

  /** Takes a picked point (`position`, `error`), or null for the background. */
  take(pick) {
    if (!pick) {
      this.#overlay.say("There is no surface here.");
      return null;
    }
    if (this.#points.length === 2) this.#points = [];
    this.#points.push(pick);
    this.place();
    this.#overlay.say(this.result ? `Distance ${describe(this.result)}` : "First point set; now the second.");
    return this.result;
  }

  place() {
    const { project, element } = this.#overlay;
    const places = this.#points.map(({ position }) => project(position));
    this.#ends.forEach((end, i) => {
      end.style.display = places[i] ? "" : "none";
      end.setAttribute("cx", places[i]?.[0] ?? 0);
      end.setAttribute("cy", places[i]?.[1] ?? 0);
    });
    const [a, b] = places;
    const shown = Boolean(a && b);
    this.#line.style.display = shown ? "" : "none";
    this.#tag.hidden = !shown;
    if (shown) {
      for (const [name, value] of [["x1", a[0]], ["y1", a[1]], ["x2", b[0]], ["y2", b[1]]]) this.#line.setAttribute(name, value);
      this.#tag.textContent = describe(this.result);
      moveTo(this.#tag, (a[0] + b[0]) / 2 + 10, (a[1] + b[1]) / 2 + 6);
    }
    const [x, y] = [element.clientWidth / 2, element.clientHeight / 2];
    this.#cross.setAttribute("d", `M${x - 12} ${y}H${x - 3}M${x + 3} ${y}H${x + 12}M${x} ${y - 12}V${y - 3}M${x} ${y + 3}V${y + 12}`);
    return false;
  }
}

/** `12.34 ± 0.05`: as many digits as the error leaves certain. */
export function describe({ distance, error }) {
  if (!(error > 0)) return String(Number(distance.toPrecision(MOST_DIGITS)));
  // The error with two digits, rounded up so that it stays a bound.
  const step = 10 ** (Math.floor(Math.log10(error)) - 1);
  const bound = Math.ceil(error / step - 1e-9) * step;
  const places = Math.max(0, -Math.floor(Math.log10(step)));
  if (places > 20) return `${distance.toPrecision(6)} ± ${error.toPrecision(2)}`;
  return `${distance.toFixed(places)} ± ${bound.toFixed(places)}`;
}
