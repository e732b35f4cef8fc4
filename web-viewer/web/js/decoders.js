// Workers that decode images, shared by all viewers of a page.
//
// A worker gets the module that the page has compiled, and bytes, which change hands without a copy. Memory is not shared, since
// that takes headers which not every host can send. Where workers cannot be had (a policy forbids them, the page is a file),
// or do not answer, whoever has images decodes them itself.

/** Most workers. */
const MOST_WORKERS = 4;
/** Jobs that a worker has at a time: one to do while the answer to the other is on its way. */
const JOBS_A_WORKER = 2;
/** Milliseconds that a worker may take to start before it counts as none. */
const START_MS = 10_000;

/** The job was not done: its worker is gone. */
export class WorkerLost extends Error {}

/** A worker from a module of ours, which may lie on another origin than the page. */
export function startWorker() {
  const url = new URL("./decoder_worker.js", import.meta.url);
  if (url.origin === location.origin) {
    return new Worker(new URL("./decoder_worker.js", import.meta.url), { type: "module", name: "marquetry decoder" });
  }
  // Pages may start workers of their own origin only; such a one may import ours.
  const script = new Blob([`import ${JSON.stringify(url.href)};`], { type: "text/javascript" });
  const local = URL.createObjectURL(script);
  const worker = new Worker(local, { type: "module", name: "marquetry decoder" });
  // Read by then.
  setTimeout(() => URL.revokeObjectURL(local), START_MS);
  return worker;
}

/** A few workers, and what they are at. */
export class Decoders {
  #workers = new Set();
  #starting = 0;
  #users = new Set();
  #nextId = 0;

  /** Starts workers that run `module`, a compiled one. */
  constructor(module, start = startWorker, processors = navigator.hardwareConcurrency ?? 2) {
    const count = Math.min(Math.max(processors - 1, 1), MOST_WORKERS);
    for (let i = 0; i < count; i++) this.#start(module, start);
  }

  /** Workers that are ready. */
  get count() {
    return this.#workers.size;
  }

  /** Whether workers will do it: some are ready, or may be soon. */
  get isThere() {
    return this.#workers.size + this.#starting > 0;
  }

  /** How many jobs `user` may give now. All users get equal parts. */
  room(user) {
    this.#users.add(user);
    const places = JOBS_A_WORKER * this.#workers.size;
    const part = Math.ceil(places / this.#users.size);
    let [taken, own] = [0, 0];
    for (const { jobs } of this.#workers) {
      taken += jobs.size;
      for (const job of jobs.values()) own += job.user === user ? 1 : 0;
    }
    return Math.max(Math.min(part - own, places - taken), 0);
  }

  /** `user` has no more to give. */
  leave(user) {
    this.#users.delete(user);
  }

  /** Has `message` decoded; the answer. Takes the message's memory. */
  run(user, message) {
    const free = [...this.#workers].sort((a, b) => a.jobs.size - b.jobs.size)[0];
    if (!free) return Promise.reject(new WorkerLost("there is no worker"));
    const id = this.#nextId++;
    return new Promise((resolve, reject) => {
      free.jobs.set(id, { user, resolve, reject });
      free.worker.postMessage({ id, message }, [message.buffer]);
    });
  }

  #start(module, start) {
    let worker;
    try {
      worker = start();
      worker.postMessage({ module });
    } catch {
      return;
    }
    this.#starting += 1;
    const own = { worker, jobs: new Map() };
    let isStarting = true;
    const started = () => {
      this.#starting -= isStarting ? 1 : 0;
      isStarting = false;
      clearTimeout(timer);
    };
    const lose = () => {
      started();
      worker.terminate();
      this.#workers.delete(own);
      for (const { reject } of own.jobs.values()) reject(new WorkerLost("a worker is gone"));
      own.jobs.clear();
      this.#tell();
    };
    const timer = setTimeout(lose, START_MS);
    worker.addEventListener("error", lose);
    worker.addEventListener("messageerror", lose);
    worker.addEventListener("message", ({ data }) => {
      if (!isStarting) {
        this.#answer(own, data, lose);
      } else if (data.ready) {
        started();
        this.#workers.add(own);
        this.#tell();
      } else {
        lose();
      }
    });
  }

  #answer(own, { id, texels, reason, isFatal }, lose) {
    const job = own.jobs.get(id);
    own.jobs.delete(id);
    if (texels) job?.resolve(texels);
    else job?.reject(new Error(reason));
    if (isFatal) lose();
  }

  /** There may be room, or no worker any more. */
  #tell() {
    for (const user of this.#users) user();
  }
}
