// From DOM events to the engine's input. The engine knows what they mean; here is only how browsers put them.

const SHIFT = 1;
const CONTROL = 2;
const ALT = 4;

/** CSS pixels of one notch, and how many of them one line or page of other wheels stands for. */
const NOTCH_PX = 100;
const PX_PER_LINE = 33;
const PX_PER_PAGE = 400;
/** Browsers report a pinch on a trackpad as a small turn of the wheel with Control held. */
const PINCH_GAIN = 8;
const MOST_NOTCHES = 4;
/** How far a pointer may move, CSS pixels, and two taps may be apart, milliseconds, to be a click and a double tap. */
const CLICK_PX = 6;
const DOUBLE_TAP_MS = 350;
const DOUBLE_TAP_PX = 30;

/**
 * Passes events on `host` to the view that `view()` returns, if any; calls `changed` when one meant something, and
 * `clicked(x, y)` for a click or tap, which returns whether that is used up. Places are pixels of the canvas that
 * `canvas()` returns. Lasts until `signal` aborts.
 */
export function listen(host, canvas, view, changed, clicked, signal) {
  const on = (type, handler) =>
    host.addEventListener(type, (event) => view() && handler(view(), event), { signal, passive: false });

  const place = (event) => {
    const box = canvas().getBoundingClientRect();
    const scale = box.width > 0 ? canvas().width / box.width : 1;
    return [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
  };

  let down = null;
  let tapped = null;
  let used = false;

  on("pointerdown", (view, event) => {
    down = event.isPrimary && event.button === 0 ? event : null;
    host.focus({ preventScroll: true });
    // A pointer of a synthetic event cannot be captured, and need not be.
    try {
      host.setPointerCapture(event.pointerId);
    } catch {}
    const touch = event.pointerType === "touch";
    if (view.pointerDown(id(event), touch, event.button, ...place(event), modifiers(event))) {
      event.preventDefault();
      changed();
    }
  });
  on("pointermove", (view, event) => {
    if (view.pointerMove(id(event), ...place(event))) changed();
  });
  on("pointerup", (view, event) => {
    const start = down;
    down = null;
    if (!start || start.pointerId !== event.pointerId || apart(start, event) > CLICK_PX) return;
    used = clicked(...place(event));
    if (event.pointerType !== "touch") return;
    const isSecond = tapped && event.timeStamp - tapped.timeStamp < DOUBLE_TAP_MS && apart(tapped, event) < DOUBLE_TAP_PX;
    tapped = isSecond || used ? null : event;
    if (isSecond && !used && view.doubleClick(...place(event))) changed();
  });
  on("dblclick", (view, event) => {
    // Of touches the taps were counted already.
    if (event.pointerType === "touch" || event.sourceCapabilities?.firesTouchEvents || used) return;
    if (view.doubleClick(...place(event))) {
      event.preventDefault();
      changed();
    }
  });
  for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) {
    on(type, (view, event) => {
      if (view.pointerUp(id(event))) changed();
    });
  }
  on("contextmenu", (_view, event) => event.preventDefault());
  on("wheel", (view, event) => {
    if (view.wheel(notches(event), ...place(event))) {
      event.preventDefault();
      changed();
    }
  });
  on("keydown", (view, event) => {
    if (event.defaultPrevented || event.metaKey) return;
    if (view.key(event.key, modifiers(event))) {
      event.preventDefault();
      changed();
    }
  });
  on("keyup", (view, event) => {
    if (view.keyUp(event.key)) changed();
  });
  // A key that goes up elsewhere is not heard of here.
  on("blur", (view) => view.blur());
}

function apart(a, b) {
  return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
}

function id(event) {
  return event.pointerId >>> 0;
}

function modifiers(event) {
  return (event.shiftKey ? SHIFT : 0) | (event.ctrlKey || event.metaKey ? CONTROL : 0) | (event.altKey ? ALT : 0);
}

export function notches(event) {
  const unit = [1, PX_PER_LINE, PX_PER_PAGE][event.deltaMode] ?? 1;
  const gain = event.ctrlKey ? PINCH_GAIN : 1;
  const turned = (event.deltaY * unit * gain) / NOTCH_PX;
  return Math.max(-MOST_NOTCHES, Math.min(MOST_NOTCHES, turned));
}
