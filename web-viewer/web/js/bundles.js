// The generated modules, one for each way to draw: the JavaScript of wasm-bindgen, and the WebAssembly.

/** By `webgpu` and `webgl2`. Bundlers know the files by these patterns alone. */
export const BUNDLES = {
  webgpu: { glue: () => import("./marquetry_web.js"), wasm: () => new URL("marquetry_web_bg.wasm", import.meta.url) },
  webgl2: { glue: () => import("./marquetry_webgl2.js"), wasm: () => new URL("marquetry_webgl2_bg.wasm", import.meta.url) },
};
