// A worker that decodes images. The first message is the compiled module; it answers that it is ready, or why it is not. Every
// later one is a job: its id and a message of the engine's.

import init, { decodeImage } from "./marquetry_web.js";

let ready = null;

addEventListener("message", async ({ data }) => {
  if (ready === null) {
    ready = init({ module_or_path: data.module });
    try {
      await ready;
      postMessage({ ready: true });
    } catch (error) {
      postMessage({ ready: false, reason: error.message });
    }
    return;
  }
  const { id, message } = data;
  try {
    const texels = decodeImage(message);
    postMessage({ id, texels }, [texels.buffer]);
  } catch (error) {
    // A panic leaves the module in a state that nothing is known of; an image that does not decode is no panic.
    postMessage({ id, reason: error.message, isFatal: error instanceof WebAssembly.RuntimeError });
  }
});
