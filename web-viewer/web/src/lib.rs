//! Browser shell of the engine: canvas, fetch, custom element.
