//! What a user may choose about a view.

use crate::{EngineError, Section};
use std::str::FromStr;

/// Size of the picture, physical pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Viewport {
    /// Pixels across, at least 1.
    pub width: u32,
    /// Pixels down, at least 1.
    pub height: u32,
}

impl Viewport {
    /// A viewport of at least one pixel.
    pub fn new(width: u32, height: u32) -> Self {
        Self {
            width: width.max(1),
            height: height.max(1),
        }
    }
}

/// How one resolution gives way to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Transition {
    /// At once: the picture pops.
    None,
    /// One picture fades into the other.
    Alpha,
    /// One picture takes the other's place pixel by pixel.
    Dither,
    /// Vertices travel between the two surfaces, as far as the projected error asks for.
    #[default]
    Geomorph,
}

impl FromStr for Transition {
    type Err = EngineError;

    /// Reads `none`, `alpha`, `dither`, `geomorph`.
    fn from_str(text: &str) -> Result<Self, EngineError> {
        match text {
            "none" => Ok(Self::None),
            "geomorph" => Ok(Self::Geomorph),
            "alpha" => Ok(Self::Alpha),
            "dither" => Ok(Self::Dither),
            _ => Err(EngineError::Option {
                name: "transition",
                value: text.to_owned(),
                expected: "none, alpha, dither or geomorph",
            }),
        }
    }
}

impl Transition {
    /// What [`Transition::from_str`] reads.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Alpha => "alpha",
            Self::Dither => "dither",
            Self::Geomorph => "geomorph",
        }
    }
}

/// What the surface's colour shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Shade {
    /// Light on the surface's own colours.
    #[default]
    Lit,
    /// The normal, each axis as a colour channel.
    Normal,
    /// A colour a resolution.
    Lod,
    /// The triangles' edges over the lit surface.
    Wire,
    /// The surface's own colours, without light.
    Unlit,
}

impl FromStr for Shade {
    type Err = EngineError;

    /// Reads `lit`, `normal`, `lod`, `wire`, `unlit`.
    fn from_str(text: &str) -> Result<Self, EngineError> {
        match text {
            "lit" => Ok(Self::Lit),
            "normal" => Ok(Self::Normal),
            "lod" => Ok(Self::Lod),
            "wire" => Ok(Self::Wire),
            "unlit" => Ok(Self::Unlit),
            _ => Err(EngineError::Option {
                name: "shade",
                value: text.to_owned(),
                expected: "lit, normal, lod, wire or unlit",
            }),
        }
    }
}

/// Colour behind the surface: sRGB, 8 bits a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Background(pub [u8; 3]);

impl Default for Background {
    fn default() -> Self {
        Self([0x20, 0x22, 0x26])
    }
}

impl FromStr for Background {
    type Err = EngineError;

    /// Reads `RRGGBB`, with or without a leading `#`.
    fn from_str(text: &str) -> Result<Self, EngineError> {
        let wrong = || EngineError::Option {
            name: "background",
            value: text.to_owned(),
            expected: "RRGGBB, six hexadecimal digits",
        };
        let digits = text.strip_prefix('#').unwrap_or(text);
        if digits.len() != 6 || !digits.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return Err(wrong());
        }
        let value = u32::from_str_radix(digits, 16).ok().ok_or_else(wrong)?;
        let [_, r, g, b] = value.to_be_bytes();
        Ok(Self([r, g, b]))
    }
}

/// Everything a [`Viewer`](crate::Viewer) can be told; each may change while it runs.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewerOptions {
    /// Largest screen-space error wanted, pixels; finite, > 0.
    pub error_px: f64,
    /// How resolutions change.
    pub transition: Transition,
    /// What is shown.
    pub shade: Shade,
    /// Colour behind the surface.
    pub background: Background,
    /// Most bytes (CPU and GPU together) that evictable pages may take. The base is not counted: it never leaves.
    pub cache_bytes: u64,
    /// Most pages decoded and uploaded in one update, small ones counted by their samples; at least 1.
    pub pages_per_update: usize,
    /// Most bytes uploaded in one update of what was decoded elsewhere; the last page may go beyond it. At least 1.
    pub upload_bytes_per_update: u64,
    /// Most requests under way at once; at least 1.
    pub requests_in_flight: usize,
    /// Seconds a transition takes ([`Transition::Geomorph`]: at least); 0 makes every change at once.
    pub morph_seconds: f64,
    /// Where the model is cut open.
    pub section: Option<Section>,
    /// Whether what is drawn stays as it is, wherever one looks from: to see a cut from outside.
    pub freeze: bool,
}

impl Default for ViewerOptions {
    fn default() -> Self {
        Self {
            error_px: 1.0,
            transition: Transition::default(),
            shade: Shade::default(),
            background: Background::default(),
            cache_bytes: 512 << 20,
            pages_per_update: 32,
            upload_bytes_per_update: 2 << 20,
            requests_in_flight: 6,
            morph_seconds: 0.25,
            section: None,
            freeze: false,
        }
    }
}

impl ViewerOptions {
    /// Checks the ranges given at the fields.
    ///
    /// # Errors
    /// [`EngineError::Option`] naming the first field outside its range.
    pub fn check(&self) -> Result<(), EngineError> {
        if !(self.error_px.is_finite() && self.error_px > 0.0) {
            return Err(EngineError::Option {
                name: "error-px",
                value: self.error_px.to_string(),
                expected: "a finite number above 0",
            });
        }
        if !(self.morph_seconds.is_finite() && self.morph_seconds >= 0.0) {
            return Err(EngineError::Option {
                name: "morph seconds",
                value: self.morph_seconds.to_string(),
                expected: "a finite number, 0 or more",
            });
        }
        if self.pages_per_update == 0
            || self.upload_bytes_per_update == 0
            || self.requests_in_flight == 0
        {
            return Err(EngineError::Option {
                name: "pages and bytes per update and requests in flight",
                value: "0".to_owned(),
                expected: "at least 1",
            });
        }
        Ok(())
    }
}
