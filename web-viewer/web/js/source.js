// Bytes of one .marq file over HTTP.
//
// Pages have URLs of their own on our server (`/pages/NAME/CONTENT-ID/FIRST-LAST`), which browsers cache for ever
// and load side by side. Whether a server has them shows at the first page: where it does not, byte ranges of the
// file itself serve on any host.

/** Milliseconds without a single byte after which a server counts as gone. */
const STALL_MS = 30_000;

/** First bytes of a file: they hold its content id. */
const FRONT_BYTES = 64;

/** Something about loading that the user can be told. `status` is 0 where there was no answer. */
export class LoadError extends Error {
  constructor(message, status = 0) {
    super(message);
    this.name = "LoadError";
    this.status = status;
  }
}

/** One file on a server. Counts what it costs. */
export class Source {
  /** Requests sent so far. */
  requests = 0;
  /** Bytes received so far. */
  bytes = 0;

  #url;
  #signal;
  #pagesUrl = null;
  #front = null;

  /** `url` is absolute; `signal` ends everything. */
  constructor(url, signal) {
    this.#url = url;
    this.#signal = signal;
  }

  /** Uses page URLs for content `contentId`, if the file lies where our server puts files. */
  usePages(contentId) {
    const { origin, pathname } = new URL(this.#url);
    const name = /^\/files\/(.+)\.marq$/.exec(pathname);
    this.#pagesUrl = name ? `${origin}/pages/${name[1]}/${contentId}` : null;
  }

  /** Whether the file still begins as it did. True before anything of it was read. */
  async isSame() {
    const front = this.#front;
    if (front === null) return true;
    const now = await this.#read(0, front.length);
    return now.length === front.length && now.every((byte, i) => byte === front[i]);
  }

  /** Bytes `start`..`end`; fewer only if the file ends before. */
  async range(start, end) {
    const bytes = await this.#read(start, end);
    if (start === 0) this.#front ??= bytes.slice(0, FRONT_BYTES);
    return bytes;
  }

  async #read(start, end) {
    const response = await this.#fetch(this.#url, {
      headers: { Range: `bytes=${start}-${end - 1}` },
      // Browsers mix up, or queue, several ranges of one URL in their cache.
      cache: "no-store",
    });
    if (response.status === 416) {
      await response.cancel();
      return new Uint8Array(0);
    }
    if (response.status === 206) {
      const answered = /^bytes (\d+)-/.exec(response.headers.get("Content-Range") ?? "");
      // Other origins may hide the header; then the checksums have to do.
      if (answered && Number(answered[1]) !== start) {
        await response.cancel();
        throw new LoadError(`the server answered with other bytes than it was asked for`);
      }
      return response.read(end - start);
    }
    if (response.status === 200 && start === 0) {
      // No ranges, but the front of the whole file is what we want.
      return response.read(end, { mayBeLonger: true });
    }
    await response.cancel();
    throw new LoadError(
      response.ok ? "the server gives no byte ranges, which this file needs" : describe(response.status),
      response.status,
    );
  }

  /** Pages `first`..=`last`, which are bytes `start`..`end`. */
  async pages(first, last, start, end) {
    if (this.#pagesUrl === null) return this.range(start, end);
    const base = this.#pagesUrl;
    const response = await this.#fetch(`${base}/${first === last ? first : `${first}-${last}`}`, {});
    if (response.status === 200) return response.read(end - start);
    await response.cancel();
    if (response.status === 410) {
      throw new LoadError("the file was replaced on the server; reload the page", 410);
    }
    if (response.status === 404 || response.status === 400 || response.status === 405) {
      // Not our server. A request sent meanwhile may have found out already.
      if (this.#pagesUrl === base) this.#pagesUrl = null;
      return this.range(start, end);
    }
    throw new LoadError(describe(response.status), response.status);
  }

  async #fetch(url, options) {
    this.requests += 1;
    const stall = new Stall(this.#signal);
    try {
      const response = await fetch(url, { ...options, signal: stall.signal });
      return new Answer(response, stall, (count) => {
        this.bytes += count;
      });
    } catch (error) {
      stall.stop();
      throw stall.explain(error);
    }
  }
}

/** A response that is read to a known length. */
class Answer {
  #response;
  #stall;
  #count;

  constructor(response, stall, count) {
    this.#response = response;
    this.#stall = stall;
    this.#count = count;
  }

  get status() {
    return this.#response.status;
  }

  get ok() {
    return this.#response.ok;
  }

  get headers() {
    return this.#response.headers;
  }

  async cancel() {
    this.#stall.stop();
    await this.#response.body?.cancel().catch(() => {});
  }

  /** At most `length` bytes. More is an error, unless they may be left unread. */
  async read(length, { mayBeLonger = false } = {}) {
    const bytes = new Uint8Array(length);
    let filled = 0;
    const reader = this.#response.body?.getReader();
    try {
      while (reader) {
        this.#stall.restart();
        const { done, value } = await reader.read();
        if (done) break;
        this.#count(value.length);
        const room = length - filled;
        bytes.set(value.subarray(0, room), filled);
        filled += Math.min(value.length, room);
        if (value.length > room || (mayBeLonger && filled === length)) {
          await reader.cancel().catch(() => {});
          if (!mayBeLonger) throw new LoadError("the server sent more bytes than it was asked for");
          break;
        }
      }
    } catch (error) {
      throw this.#stall.explain(error);
    } finally {
      this.#stall.stop();
    }
    return filled === length ? bytes : bytes.slice(0, filled);
  }
}

/** Ends a request that makes no progress, or whose owner is gone. */
class Stall {
  #controller = new AbortController();
  #timer = 0;
  #stalled = false;
  #parent;
  #abort = () => this.#controller.abort(this.#parent.reason);

  constructor(parent) {
    this.#parent = parent;
    if (parent.aborted) this.#abort();
    parent.addEventListener("abort", this.#abort, { once: true });
    this.restart();
  }

  get signal() {
    return this.#controller.signal;
  }

  restart() {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => {
      this.#stalled = true;
      this.#controller.abort();
    }, STALL_MS);
  }

  stop() {
    clearTimeout(this.#timer);
    this.#parent.removeEventListener("abort", this.#abort);
  }

  explain(error) {
    if (error instanceof LoadError || this.#parent.aborted) return error;
    return new LoadError(
      this.#stalled ? "the server stopped answering" : "the server cannot be reached, or refuses this page",
    );
  }
}

function describe(status) {
  switch (status) {
    case 401:
    case 403:
      return `the server refuses access (HTTP ${status})`;
    case 404:
    case 410:
      return `the server has no such file (HTTP ${status})`;
    default:
      return `the server failed (HTTP ${status})`;
  }
}
