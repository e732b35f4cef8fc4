//! Native shell of the engine: window, headless rendering, file and HTTP sources.
