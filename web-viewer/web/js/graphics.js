// What pictures are drawn with, and the engine for it: WebGPU, or WebGL 2 where the browser has no WebGPU or no adapter for it.
// Each has a bundle of its own; a page fetches the one that it needs.

import { BUNDLES } from "./bundles.js";
import { Decoders } from "./decoders.js";
import { LoadError } from "./source.js";
import { sentence } from "./text.js";

/** Neither is there, or what is there draws nothing. */
export class MissingGraphics extends Error {
  constructor(reason) {
    super(
      (reason ? `${sentence(reason)} ` : "") +
        "The viewer draws with WebGPU or with WebGL 2, and this browser offers neither" +
        (window.isSecureContext ? ": graphics acceleration may have to be switched on." : " here."),
    );
  }
}

/** The bundle that was asked for, once for all viewers of the page. */
let api;
/** The generated module, loaded once for all viewers of the page, and the workers that run it as well. */
let engine;
let workers;
/** The module that draws with WebGPU, if that was loaded. */
let webgpu;

/** The engine for what this browser draws with. */
export function loadEngine() {
  if (engine) return engine;
  engine = load().catch((error) => {
    // The next viewer, or the next try, may have more luck.
    engine = undefined;
    if (error instanceof MissingGraphics) throw error;
    throw new LoadError(`the viewer itself cannot be loaded: ${error.message}`);
  });
  return engine;
}

/** Draws with WebGL 2 from now on, as `module` got no device; whether that is another try, since it was WebGPU's. */
export function giveUpWebGpu(module) {
  if (!module || module !== webgpu) return false;
  if (api === "webgpu") [api, engine] = ["webgl2", undefined];
  return true;
}

/** The workers that decode images; there once the engine is. */
export function decoders() {
  return workers;
}

async function load() {
  const own = (api ??= await chosen());
  const { glue, wasm } = BUNDLES[own];
  const compiled = compile(fetch(wasm()));
  compiled.catch(() => {});
  const module = await glue();
  await module.default({ module_or_path: compiled });
  if (own === "webgpu") webgpu = module;
  workers ??= new Decoders(own, await compiled);
  return module;
}

async function chosen() {
  const adapter = await navigator.gpu?.requestAdapter().catch(() => null);
  if (adapter) return "webgpu";
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) throw new MissingGraphics();
  // A page has few of them.
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return "webgl2";
}

async function compile(fetched) {
  const response = await fetched;
  if (!response.ok) throw new Error(`HTTP ${response.status}`);
  const isNamed = response.headers.get("Content-Type")?.startsWith("application/wasm");
  // Some hosts do not know what wasm is.
  return isNamed ? WebAssembly.compileStreaming(response) : WebAssembly.compile(await response.arrayBuffer());
}
