//! Textures: from the images of the source to the colour tiles of the charts.
//!
//! [`appearance`] is what importers hand over: images, materials, and for every imported triangle its material and its
//! corners' texture coordinates. [`coarse`] makes vertex colours of it, which the geometry carries through as it does
//! any others; [`seams`] makes images of plain colours where that would blur them, [`sparse`] plain colours of images that have next to no texels. [`source`] finds, for every triangle of a chart, where in which image it lies; [`density`] how many
//! texels that is worth; [`raster`] and [`surround`] sample the chart and what lies beyond its sides; [`pyramid`] filters
//! and cuts tiles; [`encode`] compresses them; [`build`] does all of this for every chart. Clusters have textures of their own ([`cluster`]).
//!
//! Colours are filtered in linear light throughout. Limits: the alpha channel, normal maps, and everything but the base
//! colour are left out.

pub mod appearance;
pub mod build;
pub mod cluster;
pub mod coarse;
pub mod density;
pub mod encode;
pub mod images;
pub mod light;
pub mod pyramid;
pub mod raster;
pub mod seams;
pub mod source;
pub mod sparse;
pub mod stage;
pub mod surround;
