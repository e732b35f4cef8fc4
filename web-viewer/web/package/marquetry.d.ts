/** What a request for the file has cost so far. */
export interface Cost {
  requests: number;
  bytes: number;
}

/** A point of the surface. */
export interface Pick {
  /** World coordinates, the file's units. */
  position: [number, number, number];
  /** Unit normal of the triangle there, towards the eye. */
  normal: [number, number, number];
  /** Most that the surface drawn there is away from the source, the file's units. */
  error: number;
}

/** A distance between two points of the surface, the file's units. */
export interface Measurement {
  distance: number;
  /** Most that finer data could change it by. */
  error: number;
  points: [[number, number, number], [number, number, number]];
}

/** What is drawn and what it took: the keys of `marquetry render --json`, and what the network did. */
export interface Stats {
  frame_ms: number | null;
  cpu_ms: number | null;
  gpu_ms: number | null;
  triangles: number;
  nodes: number;
  draw_calls: number;
  pages: { requested: number; fetched: number; bytes: number; missing: number };
  cache: { capacity_bytes: number; used_bytes: number; pinned_bytes: number; evictions: number };
  failures: number;
  error_px: number | null;
  adapter: string;
  /** Workers, images that they decoded, and what was decoded on the page's own thread, with the milliseconds it took. */
  decoding: { workers: number; by_workers: number; here: { images: number; meshes: number; ms: number } };
  network: Cost;
}

/** Facts of the file. */
export interface Facts {
  source_triangles: number;
  charts: number;
  pages: number;
  bounds: { min: [number, number, number]; max: [number, number, number] };
}

/** Something went wrong. */
export interface ErrorDetail {
  /** In a sentence, for the reader. */
  message: string;
  /** Whether there is no picture any more. */
  fatal: boolean;
  /**
   * `graphics`: neither WebGPU nor WebGL 2 here. `network`, `file`: the file cannot be had, or is not valid. `device`: the graphics device was lost
   * and is started again. `replaced`: another file is there now. `option`: a wrong attribute. `annotations`: the notes.
   */
  kind: "graphics" | "network" | "file" | "device" | "replaced" | "option" | "annotations";
}

/** Events of the element, by name. */
export interface MarquetryViewerEventMap extends HTMLElementEventMap {
  /** The first image is there. */
  ready: CustomEvent<Cost>;
  progress: CustomEvent<Cost & { progress: number }>;
  /** Nothing is missing for this view. */
  settled: CustomEvent<Cost>;
  camerachange: CustomEvent<{ camera: string }>;
  shadechange: CustomEvent<{ shade: Shade }>;
  modechange: CustomEvent<{ flying: boolean; frozen: boolean; measuring: boolean }>;
  measure: CustomEvent<Measurement>;
}

export type Shade = "lit" | "normal" | "lod" | "wire" | "unlit";
export type Transition = "none" | "alpha" | "dither" | "geomorph";
export type State = "empty" | "loading" | "ready" | "settled" | "failed";

/**
 * `<marquetry-viewer src="scan.marq">`.
 *
 * Attributes: `src`, `error-px`, `transition`, `shade`, `background` (RRGGBB), `cache` (bytes), `section` (`x,0.5`;
 * `-x,0.5` keeps the upper part; `NX,NY,NZ,OFFSET` any plane), `camera`, `time`, `annotations` (URL; empty for the file
 * beside `src` that ends in `.annotations.json`).
 */
export declare class MarquetryViewer extends HTMLElement {
  src: string;
  /** `eye.x,eye.y,eye.z,target.x,target.y,target.z`; empty before `ready`. */
  camera: string;
  shade: Shade;
  transition: Transition;
  section: string;
  flying: boolean;
  /** Whether what is drawn stays as it is, wherever one looks from. */
  frozen: boolean;
  /** Whether clicks pick points to measure between. */
  measuring: boolean;
  readonly measurement: Measurement | null;
  readonly state: State;
  readonly time: number;
  stats(): Stats | null;
  facts(): Facts | null;
  /** A PNG. */
  screenshot(): Promise<Blob>;
  setTime(time: number): void;
  reload(): void;
  /** The surface at a place, CSS pixels from the element's upper left corner; null on the background. */
  pick(x: number, y: number): Pick | null;
  /** Where a point is, CSS pixels from the element's upper left corner; null behind the eye. */
  project(point: [number, number, number]): [number, number] | null;
  addEventListener<K extends keyof MarquetryViewerEventMap>(
    type: K,
    listener: (this: MarquetryViewer, event: MarquetryViewerEventMap[K]) => unknown,
    options?: boolean | AddEventListenerOptions,
  ): void;
  /** `error` events carry an {@link ErrorDetail} as their `detail`. */
  addEventListener(type: string, listener: EventListenerOrEventListenerObject, options?: boolean | AddEventListenerOptions): void;
}

declare global {
  interface HTMLElementTagNameMap {
    "marquetry-viewer": MarquetryViewer;
  }
}
