//! Cut, residency, streaming and drawing of atlases with wgpu; no window, no browser API.
