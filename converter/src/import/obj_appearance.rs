//! Materials and texture coordinates of Wavefront OBJ and its MTL files, read in a pass of their own.
//!
//! `map_Kd` with the options `-s`, `-o` and `-clamp`, `Kd`; normal maps (`norm`, `map_Bump`, `bump`) are counted. A library or image
//! that cannot be read costs a warning, not the conversion. Files without `mtllib` cost nothing.

use super::faces::Faces;
use super::text::{integer, lines, number, words};
use super::{Soup, colour, detect, references};
use crate::error::Place;
use crate::texture::appearance::{
    Appearance, ImageFile, Material, NO_MATERIAL, TexturedFace, Wrap,
};
use glam::{Vec2, Vec3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A material as its library says, and how its texture coordinates are moved.
#[derive(Debug, Clone, Copy)]
struct Known {
    number: u32,
    scale: Vec2,
    offset: Vec2,
}

/// What a corner says: texture coordinates, counted from 0, and the material that is in use.
#[derive(Debug, Clone, Copy)]
struct Corner {
    uv: Option<usize>,
    material: Option<Known>,
}

/// Reads the appearance of the faces of `soup`, which were read from `bytes`.
pub(super) fn read(bytes: &[u8], path: &Path, soup: &mut Soup) {
    let bytes = detect::without_bom(bytes);
    let mut libraries = Libraries::new(path);
    let mut current = None;
    let (mut uvs, mut corners) = (Vec::new(), Vec::new());
    let mut text = lines(bytes);
    let mut joined = Vec::new();
    let starts_with = |line: &[u8], word: &[u8]| {
        line.strip_prefix(word)
            .is_some_and(|rest| rest.first().is_some_and(u8::is_ascii_whitespace))
    };
    if !lines(bytes).any(|(_, line)| starts_with(line.trim_ascii(), b"mtllib")) {
        return;
    }
    while let Some((_, line)) = text.next() {
        let mut line = line.trim_ascii();
        if line.ends_with(b"\\") {
            joined.clear();
            joined.extend_from_slice(line);
            while joined.ends_with(b"\\") {
                joined.pop();
                joined.push(b' ');
                let next = text.next().map_or(&b""[..], |(_, next)| next.trim_ascii());
                joined.extend_from_slice(next);
            }
            line = &joined;
        }
        let argument = |line: &[u8]| name_of(line.split_at_checked(6).unwrap_or_default().1);
        if starts_with(line, b"mtllib") {
            libraries.load(&argument(line));
        } else if starts_with(line, b"usemtl") {
            current = libraries.known.get(&argument(line)).copied();
            if current.is_none() {
                libraries.miss(&argument(line));
            }
        } else if starts_with(line, b"vt") {
            let mut values = words(line).skip(1).map(float);
            let mut next = || values.next().unwrap_or_default();
            uvs.push(Vec2::new(next(), next()));
        } else if starts_with(line, b"f") || starts_with(line, b"fo") {
            let line = line.split(|&b| b == b'#').next().unwrap_or_default();
            let start = corners.len();
            corners.extend(
                words(line)
                    .filter(|w| !w.is_empty())
                    .skip(1)
                    .map(|word| Corner {
                        uv: uv_of(word, uvs.len()),
                        material: current,
                    }),
            );
            if corners.len() - start < 3 {
                corners.truncate(start);
            }
        }
    }
    let mut appearance = libraries.appearance;
    put_on(
        &soup.faces,
        &soup.positions,
        &corners,
        &uvs,
        &mut appearance,
    );
    soup.appearance = appearance;
}

/// Gives every triangle its face's material and its corners' coordinates.
fn put_on(
    faces: &Faces,
    positions: &[glam::DVec3],
    corners: &[Corner],
    uvs: &[Vec2],
    appearance: &mut Appearance,
) {
    if !faces.fits(positions.len(), corners.len()) {
        return;
    }
    let mut triangles = Vec::new();
    faces.carry(positions, corners, &mut triangles);
    let mut without = 0;
    let face = |triangle: &[Corner; 3]| {
        let Some(known) = triangle[0].material else {
            return TexturedFace::PLAIN;
        };
        let places = triangle.map(|corner| {
            let uv = *uvs.get(corner.uv?)? * known.scale + known.offset;
            // OBJ counts v from the lower edge.
            Some(Vec2::new(uv.x, 1.0 - uv.y))
        });
        if let [Some(a), Some(b), Some(c)] = places {
            return TexturedFace {
                material: known.number,
                uv: [a, b, c],
            };
        }
        let material = appearance.materials.get(known.number as usize);
        if material.is_some_and(|m| m.image.is_some()) {
            without += 1;
            return TexturedFace::PLAIN;
        }
        TexturedFace {
            material: known.number,
            ..TexturedFace::PLAIN
        }
    };
    appearance.faces = triangles.iter().map(face).collect();
    if without > 0 {
        appearance.warnings.push(format!(
            "{without} triangles have a texture and no texture coordinates; they are drawn without it"
        ));
    }
}

fn name_of(rest: &[u8]) -> String {
    String::from_utf8_lossy(rest.trim_ascii()).into_owned()
}

fn float(word: &[u8]) -> f32 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "texture coordinates are small"
    )]
    number(word, Place::File, "a number").map_or(0.0, |value| value as f32)
}

/// The texture coordinates of a corner `v/vt` or `v/vt/vn`.
fn uv_of(word: &[u8], count: usize) -> Option<usize> {
    let field = word
        .split(|&b| b == b'/')
        .nth(1)
        .filter(|f| !f.is_empty())?;
    let index = integer(field, Place::File, "an index").ok()?;
    match index {
        0 => None,
        1.. => usize::try_from(index - 1).ok(),
        _ => count.checked_sub(usize::try_from(index.unsigned_abs()).ok()?),
    }
}

/// Material libraries read so far.
struct Libraries<'a> {
    path: &'a Path,
    appearance: Appearance,
    known: BTreeMap<String, Known>,
    images: BTreeMap<PathBuf, Option<u32>>,
    missed: Vec<String>,
}

impl<'a> Libraries<'a> {
    fn new(path: &'a Path) -> Self {
        Self {
            path,
            appearance: Appearance::default(),
            known: BTreeMap::new(),
            images: BTreeMap::new(),
            missed: Vec::new(),
        }
    }

    /// Warns once of a material that no library has.
    fn miss(&mut self, name: &str) {
        // Without its library, every material is missing; that has been said.
        if !self.known.is_empty() && !self.missed.iter().any(|known| known == name) {
            self.missed.push(name.to_owned());
            self.appearance.warnings.push(format!(
                "there is no material `{name}`; its faces are drawn without"
            ));
        }
    }

    fn load(&mut self, name: &str) {
        let relative = relative_path(name);
        let text = match references::beside(self.path, &relative) {
            Ok(text) => text,
            Err(cause) => {
                self.appearance.warnings.push(format!(
                    "the material library cannot be read ({cause}); its materials are drawn without colour"
                ));
                return;
            }
        };
        let folder = relative.parent().map(Path::to_path_buf).unwrap_or_default();
        let mut current: Option<(String, Known)> = None;
        for (_, line) in lines(detect::without_bom(&text)) {
            let line = line.trim_ascii();
            let end = line
                .iter()
                .position(u8::is_ascii_whitespace)
                .unwrap_or(line.len());
            let (word, rest) = line.split_at(end);
            match word.to_ascii_lowercase().as_slice() {
                b"newmtl" => {
                    self.known.extend(current.take());
                    let number = u32::try_from(self.appearance.materials.len()).ok();
                    let Some(number) = number.filter(|&n| n != NO_MATERIAL) else {
                        return;
                    };
                    self.appearance.materials.push(Material::default());
                    let known = Known {
                        number,
                        scale: Vec2::ONE,
                        offset: Vec2::ZERO,
                    };
                    current = Some((name_of(rest), known));
                }
                b"kd" => {
                    let values: Vec<f32> =
                        words(rest).filter(|w| !w.is_empty()).map(float).collect();
                    if let (Some(material), [r, g, b, ..]) =
                        (self.of(current.as_ref()), values.as_slice())
                    {
                        material.factor = kd(*r, *g, *b);
                    }
                }
                b"map_kd" => self.map(rest, &folder, &mut current),
                b"norm" | b"map_bump" | b"bump" => self.appearance.normal_maps += 1,
                _ => {}
            }
        }
        self.known.extend(current);
        // Black times an image is black: written by programs that mean the image alone.
        for material in &mut self.appearance.materials {
            if material.image.is_some() && material.factor == Vec3::ZERO {
                material.factor = Vec3::ONE;
            }
        }
    }

    fn of(&mut self, current: Option<&(String, Known)>) -> Option<&mut Material> {
        let (_, known) = current?;
        self.appearance.materials.get_mut(known.number as usize)
    }

    fn map(&mut self, rest: &[u8], folder: &Path, current: &mut Option<(String, Known)>) {
        let map = Map::parse(rest);
        let image = self.image(&folder.join(relative_path(&map.file)));
        if let Some((_, known)) = current {
            known.scale = map.scale;
            known.offset = map.offset;
        }
        if let Some(material) = self.of(current.as_ref()) {
            material.image = image;
            material.wrap = [map.wrap; 2];
        }
    }

    fn image(&mut self, relative: &Path) -> Option<u32> {
        if let Some(known) = self.images.get(relative) {
            return *known;
        }
        let number = match references::beside(self.path, relative) {
            Ok(bytes) => {
                self.appearance.images.push(ImageFile {
                    name: relative.display().to_string(),
                    bytes,
                });
                u32::try_from(self.appearance.images.len() - 1).ok()
            }
            Err(cause) => {
                self.appearance.warnings.push(format!(
                    "a texture cannot be read ({cause}); its materials are drawn without it"
                ));
                None
            }
        };
        self.images.insert(relative.to_path_buf(), number);
        number
    }
}

/// `Kd` is sRGB in what scanners write; many leave it grey beside a texture that carries the colour, as it is.
fn kd(r: f32, g: f32, b: f32) -> Vec3 {
    crate::atlas::colour::linear_from_srgb([r, g, b].map(|c| colour::byte_from_unit(f64::from(c))))
}

/// Backslashes are what Windows programs write.
fn relative_path(name: &str) -> PathBuf {
    PathBuf::from(name.trim_matches('"').replace('\\', "/"))
}

/// The arguments of `map_Kd`.
#[derive(Debug, PartialEq)]
struct Map {
    file: String,
    scale: Vec2,
    offset: Vec2,
    wrap: Wrap,
}

impl Map {
    fn parse(rest: &[u8]) -> Self {
        let mut map = Self {
            file: String::new(),
            scale: Vec2::ONE,
            offset: Vec2::ZERO,
            wrap: Wrap::Repeat,
        };
        let mut rest = rest.trim_ascii();
        while rest.first() == Some(&b'-') {
            let option = take_word(&mut rest);
            match option {
                b"-s" | b"-o" | b"-t" => {
                    let mut values = Vec::new();
                    while values.len() < 3 && is_number(rest) {
                        values.push(float(take_word(&mut rest)));
                    }
                    let get = |k: usize, other: f32| values.get(k).copied().unwrap_or(other);
                    match option {
                        b"-s" => map.scale = Vec2::new(get(0, 1.0), get(1, 1.0)),
                        b"-o" => map.offset = Vec2::new(get(0, 0.0), get(1, 0.0)),
                        _ => {}
                    }
                }
                b"-clamp" => {
                    if take_word(&mut rest).eq_ignore_ascii_case(b"on") {
                        map.wrap = Wrap::Clamp;
                    }
                }
                b"-mm" => {
                    take_word(&mut rest);
                    take_word(&mut rest);
                }
                _ => {
                    take_word(&mut rest);
                }
            }
        }
        map.file = name_of(rest);
        map
    }
}

fn take_word<'a>(rest: &mut &'a [u8]) -> &'a [u8] {
    let end = rest
        .iter()
        .position(u8::is_ascii_whitespace)
        .unwrap_or(rest.len());
    let (word, after) = rest.split_at(end);
    *rest = after.trim_ascii();
    word
}

/// Whether the next word is a number and not the last, which is the file.
fn is_number(rest: &[u8]) -> bool {
    let mut after = rest;
    let word = take_word(&mut after);
    !after.is_empty() && number(word, Place::File, "").is_ok()
}

#[cfg(test)]
mod tests;
