// The page around the viewer: which file, which shading, how far, where from.
//
// The address says it all: `?file=NAME` which scan (and `&annotations=URL` its notes), `#camera=…&shade=…&section=…` the
// view, so a link reproduces it.

import "./marquetry.js";
import { describe } from "./measure.js";
import { connectPanel, showInPanel } from "./view_panel.js";

/** Milliseconds that the camera rests before it is written to the address. */
const ADDRESS_DELAY_MS = 250;
const STATS_MS = 250;
const NOTICE_MS = 6000;
/** Digits of a coordinate in the address: far finer than a pixel. */
const DIGITS = 9;

const BACKGROUNDS = { dark: "202226", light: "e7e8ea" };

const find = (id) => document.getElementById(id);
const light = matchMedia("(prefers-color-scheme: light)");
const numbers = new Intl.NumberFormat("en", { maximumFractionDigits: 1 });
const compact = new Intl.NumberFormat("en", { notation: "compact", maximumSignificantDigits: 3 });

let viewer = null;
let addressTimer = 0;
let noticeTimer = 0;

async function main() {
  find("help-button").addEventListener("click", () => find("help").showModal());
  find("stats-button").addEventListener("click", toggleStats);
  find("save-button").addEventListener("click", save);
  find("panel-button").addEventListener("click", togglePanel);
  find("measure-button").addEventListener("click", toggleMeasure);
  connectPanel(() => viewer, writeAddress);
  find("shades").addEventListener("change", (event) => {
    if (viewer) viewer.shade = event.target.value;
  });
  addEventListener("keydown", onKey);
  addEventListener("hashchange", applyAddress);
  light.addEventListener("change", () => viewer?.setAttribute("background", background()));
  setInterval(showStats, STATS_MS);

  const name = new URLSearchParams(location.search).get("file");
  if (name) show(name.replace(/\.marq$/, ""));
  else await showCatalogue();
}

/** Lists what is served; one file alone is shown at once. */
async function showCatalogue() {
  let files;
  try {
    const response = await fetch("/api/catalogue");
    if (!response.ok) throw new Error(`HTTP ${response.status}`);
    ({ files } = await response.json());
  } catch (error) {
    find("catalogue").hidden = false;
    find("catalogue-note").textContent = `The server does not say what it has (${error.message}). Reload to try again.`;
    return;
  }
  if (files.length === 1) {
    show(files[0].name, files[0].url);
    return;
  }
  find("catalogue").hidden = false;
  find("catalogue-note").textContent =
    files.length === 0 ? "There is none. Convert one with `marquetry convert` and serve it." : `${files.length} scans`;
  find("files").replaceChildren(
    ...files.map((file) => {
      const link = document.createElement("a");
      link.href = `?file=${encodeURIComponent(file.name)}`;
      const picture = document.createElement(file.thumbnail_url ? "img" : "span");
      picture.className = "picture";
      if (file.thumbnail_url) {
        // The name follows, so it is not said twice.
        Object.assign(picture, { alt: "", loading: "lazy", width: 256, height: 192, src: file.thumbnail_url });
      }
      const title = document.createElement("strong");
      title.textContent = file.title ?? file.name;
      const facts = document.createElement("span");
      facts.textContent = `${compact.format(file.triangles)} triangles · ${bytes(file.bytes)}`;
      link.append(picture, title, facts);
      for (const text of [file.attribution, file.licence]) {
        if (!text) continue;
        const line = document.createElement("small");
        line.textContent = text;
        link.append(line);
      }
      const item = document.createElement("li");
      item.append(link);
      return item;
    }),
  );
}

function show(name, url = `/files/${name.split("/").map(encodeURIComponent).join("/")}.marq`) {
  document.title = `${name} · Marquetry`;
  find("title").textContent = name;
  find("stage").hidden = false;
  find("tools").hidden = false;
  viewer = document.createElement("marquetry-viewer");
  viewer.setAttribute("aria-label", `${name}, 3D scan: arrow keys orbit, plus and minus zoom, question mark for help`);
  viewer.setAttribute("background", background());
  const address = new URLSearchParams(location.hash.slice(1));
  const notes = new URLSearchParams(location.search).get("annotations");
  if (notes !== null) viewer.setAttribute("annotations", notes);
  for (const option of ["camera", "shade", "error-px", "transition", "section"]) {
    const value = address.get(option);
    if (value) viewer.setAttribute(option, value);
  }
  find("progress").classList.add("busy");
  viewer.addEventListener("progress", ({ detail }) => showProgress(detail.progress));
  viewer.addEventListener("settled", () => {
    showProgress(1);
    find("progress").classList.remove("busy");
  });
  viewer.addEventListener("shadechange", ({ detail }) => {
    find("shades").querySelector(`[value="${detail.shade}"]`).checked = true;
    writeAddress();
  });
  viewer.addEventListener("ready", () => showInPanel(viewer));
  viewer.addEventListener("modechange", () => showInPanel(viewer));
  viewer.addEventListener("measure", ({ detail }) => notify(`Distance ${describe(detail)}`));
  viewer.addEventListener("camerachange", () => {
    clearTimeout(addressTimer);
    addressTimer = setTimeout(writeAddress, ADDRESS_DELAY_MS);
  });
  viewer.addEventListener("error", ({ detail }) => {
    if (detail.fatal) find("progress").classList.remove("busy");
    else notify(detail.kind === "network" ? `A part of the scan is late: ${detail.message} Trying again.` : detail.message);
  });
  viewer.setAttribute("src", url);
  find("stage").append(viewer);
  viewer.focus({ preventScroll: true });
}

function background() {
  return light.matches ? BACKGROUNDS.light : BACKGROUNDS.dark;
}

function showProgress(part) {
  const bar = find("progress");
  bar.classList.toggle("busy", part < 1);
  bar.style.setProperty("--done", part);
  bar.setAttribute("aria-valuenow", Math.round(part * 100));
}

/** Takes the view from the address: somebody went back, or edited it. */
function applyAddress() {
  const address = new URLSearchParams(location.hash.slice(1));
  const camera = address.get("camera");
  if (!viewer?.camera) return;
  try {
    if (camera && camera !== rounded(viewer.camera)) viewer.camera = camera;
    viewer.shade = address.get("shade") ?? "lit";
    viewer.transition = address.get("transition") ?? "geomorph";
    viewer.section = address.get("section") ?? "";
    showInPanel(viewer);
  } catch (error) {
    notify(error.message);
  }
}

function writeAddress() {
  if (!viewer?.camera) return;
  const differing = Object.entries({ shade: "lit", transition: "geomorph", section: "" })
    .filter(([name, usual]) => viewer[name] !== usual)
    .map(([name]) => `&${name}=${viewer[name]}`)
    .join("");
  const errorPx = viewer.hasAttribute("error-px") ? `&error-px=${viewer.getAttribute("error-px")}` : "";
  const query = viewer.camera && !location.search ? `?file=${encodeURIComponent(find("title").textContent)}` : location.search;
  history.replaceState(null, "", `${location.pathname}${query}#camera=${rounded(viewer.camera)}${differing}${errorPx}`);
}

function rounded(camera) {
  return camera.split(",").map((number) => String(Number(Number(number).toPrecision(DIGITS)))).join(",");
}

function togglePanel() {
  const panel = find("panel");
  panel.hidden = !panel.hidden;
  find("panel-button").setAttribute("aria-pressed", String(!panel.hidden));
  if (!panel.hidden) {
    showInPanel(viewer);
    find("section-axis").focus();
  }
}

function toggleMeasure() {
  viewer.measuring = !viewer.measuring;
  showInPanel(viewer);
  if (!viewer.measuring) return;
  viewer.focus({ preventScroll: true });
  notify("Click two points, or aim with the arrow keys and press Enter. Escape ends it.");
}

function toggleStats() {
  const panel = find("stats");
  panel.hidden = !panel.hidden;
  find("stats-button").setAttribute("aria-pressed", String(!panel.hidden));
  showStats();
}

function showStats() {
  const panel = find("stats");
  const stats = panel.hidden ? null : viewer?.stats();
  if (!stats) return;
  const facts = viewer.facts();
  const rows = [
    ["Scan", `${compact.format(facts.source_triangles)} triangles`],
    ["Drawn", `${compact.format(stats.triangles)} in ${stats.nodes} nodes`],
    ["Fetched", `${bytes(stats.network.bytes)} in ${stats.network.requests} requests`],
    ["Missing", `${stats.pages.missing} pages`],
    ["Cache", `${bytes(stats.cache.used_bytes)} of ${bytes(stats.cache.capacity_bytes)}`],
    ["Error aimed at", `${numbers.format(stats.error_px)} px`],
    ["Frame", stats.frame_ms === null ? "at rest" : `${numbers.format(stats.frame_ms)} ms (${numbers.format(stats.cpu_ms)} ms CPU)`],
    ["Frames a second", stats.frame_ms > 0 ? numbers.format(1000 / stats.frame_ms) : "at rest"],
  ];
  panel.replaceChildren(
    ...rows.flatMap(([name, value]) => {
      const term = document.createElement("dt");
      term.textContent = name;
      const text = document.createElement("dd");
      text.textContent = value;
      return [term, text];
    }),
  );
}

async function save() {
  try {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(await viewer.screenshot());
    link.download = `${find("title").textContent.split("/").at(-1)}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  } catch (error) {
    notify(error.message);
  }
}

function notify(text) {
  const notice = find("notice");
  notice.textContent = text;
  notice.hidden = false;
  clearTimeout(noticeTimer);
  noticeTimer = setTimeout(() => (notice.hidden = true), NOTICE_MS);
}

function onKey(event) {
  if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || find("help").open) return;
  // Letters choose in a list.
  if (event.target.localName === "select") return;
  if (event.key === "?") find("help").showModal();
  else if (event.key === "i" && viewer) toggleStats();
  else if (event.key === "o" && viewer) togglePanel();
  else if (event.key === "m" && viewer) toggleMeasure();
  else if (event.key === "f" && viewer) {
    if (document.fullscreenElement) document.exitFullscreen();
    else find("stage").requestFullscreen().catch(() => {});
  }
}

function bytes(count) {
  if (count < 1024) return `${count} B`;
  if (count < 1024 * 1024) return `${numbers.format(count / 1024)} KiB`;
  return `${numbers.format(count / 1024 / 1024)} MiB`;
}

main();
