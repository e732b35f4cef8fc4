// What of one view is decoded where: images by workers, meshes on this thread, since sending them takes as long.

import { WorkerLost } from "./decoders.js";

/** Part of the time since the last frame for decoding on this thread, and most milliseconds; a job that has begun is finished. */
const SHARE_HERE = 0.25;
const MOST_MS_HERE = 16;
/** Meshes between two looks at the clock. */
const MESHES_A_LOOK = 4;

/** The decoding of a view. */
export class Decoding {
  #view;
  #decoders;
  #onChange;
  #byWorkers = 0;
  #here = { images: 0, meshes: 0, ms: 0 };
  /** Stands for this view among those who share the workers: they have room, or are gone. */
  #user = () => {
    this.feed();
    this.#onChange();
  };

  /** `onChange` is called when something was decoded. */
  constructor(view, decoders, onChange) {
    this.#view = view;
    this.#decoders = decoders;
    this.#onChange = onChange;
  }

  /** Workers, images that they decoded, and what was decoded here. */
  get stats() {
    return { workers: this.#decoders.count, by_workers: this.#byWorkers, here: { ...this.#here } };
  }

  /** Decodes meshes, and images where no worker will, the last frame being so long ago; to be called before the next. */
  decodeHere(sinceLastMs) {
    const start = performance.now();
    const end = start + Math.min(SHARE_HERE * sinceLastMs, MOST_MS_HERE);
    let [meshes, images] = [0, 0];
    do {
      meshes = this.#view.decodeHere(false, MESHES_A_LOOK);
      images = this.#decoders.isThere ? 0 : this.#view.decodeHere(true, 1);
      this.#here.meshes += meshes;
      this.#here.images += images;
    } while (meshes + images > 0 && performance.now() < end);
    this.#here.ms += performance.now() - start;
  }

  /** Gives workers what they have room for; to be called after each frame. */
  feed() {
    const room = this.#view ? this.#decoders.room(this.#user) : 0;
    if (room === 0) return;
    const images = this.#view.takeImages(room);
    this.#decoders.wait(this.#user, images.length >= 2 * room);
    for (let i = 0; i < images.length; i += 2) this.#send(images[i], images[i + 1]);
  }

  /** The view is gone. */
  end() {
    this.#view = null;
    this.#decoders.leave(this.#user);
  }

  async #send(id, message) {
    let texels = null;
    let failure = null;
    try {
      texels = await this.#decoders.run(this.#user, message);
    } catch (error) {
      failure = error;
    }
    const view = this.#view;
    if (!view) return;
    if (texels) {
      this.#byWorkers += 1;
      view.finishImage(id, texels);
    } else if (failure instanceof WorkerLost) {
      view.decodeLostImage(id);
      this.#here.images += 1;
    } else {
      view.failImage(id, failure.message);
    }
    this.#user();
  }
}
