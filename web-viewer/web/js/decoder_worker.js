// A worker that decodes images. The first message is the compiled module and whose it is; it answers that it is ready, or why it
// is not. Every later one is a job: its id and a message of the engine's.

import { BUNDLES } from "./bundles.js";

let engine = null;

addEventListener("message", async ({ data }) => {
  if (engine === null) {
    try {
      engine = await BUNDLES[data.api].glue();
      await engine.default({ module_or_path: data.module });
      postMessage({ ready: true });
    } catch (error) {
      postMessage({ ready: false, reason: error.message });
    }
    return;
  }
  const { id, message } = data;
  try {
    const texels = engine.decodeImage(message);
    postMessage({ id, texels }, [texels.buffer]);
  } catch (error) {
    // A panic leaves the module in a state that nothing is known of; an image that does not decode is no panic.
    postMessage({ id, reason: error.message, isFatal: error instanceof WebAssembly.RuntimeError });
  }
});
