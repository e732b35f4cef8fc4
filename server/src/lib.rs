//! Tile server for .marq files.
