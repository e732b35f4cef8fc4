//! Data laid out for the shaders.
