//! Typed arrays in buffers.

use super::{Document, fault};
use crate::error::ParseError;
use ::gltf::json::accessor::{ComponentType, Type};
use ::gltf::json::validation::{Checked, USize64};
use ::gltf::json::{Accessor, Index, buffer};

/// An accessor's elements as numbers, one after the other.
#[derive(Debug)]
pub(super) struct Elements {
    pub(super) values: Vec<f64>,
    /// Numbers an element.
    pub(super) width: usize,
}

/// Bytes `count` elements of `size` bytes, `stride` apart.
#[derive(Debug, Clone, Copy)]
struct Layout {
    offset: usize,
    stride: usize,
    size: usize,
    count: usize,
}

impl Document {
    fn accessor(&self, index: Index<Accessor>) -> Result<&Accessor, ParseError> {
        let i = index.value();
        self.root
            .accessors
            .get(i)
            .ok_or_else(|| fault(format!("there is no accessor {i}")))
    }

    /// Reads positions or colours; `normalized` integers are scaled to 0..=1 or −1..=1.
    pub(super) fn elements(&self, index: Index<Accessor>) -> Result<Elements, ParseError> {
        let accessor = self.accessor(index)?;
        let bad = |cause: &str| fault(format!("accessor {}: {cause}", index.value()));
        let Checked::Valid(component) = accessor.component_type else {
            return Err(bad("unknown component type"));
        };
        let width = match accessor.type_ {
            Checked::Valid(t @ (Type::Scalar | Type::Vec2 | Type::Vec3 | Type::Vec4)) => {
                t.multiplicity()
            }
            _ => return Err(bad("neither a number nor a vector")),
        };
        let component = component.0;
        let count = self
            .bounded(accessor.count)
            .ok_or_else(|| bad("more elements than the buffers have bytes"))?;
        let scale = if accessor.normalized {
            unit_scale(component)
        } else {
            1.0
        };
        let size = width * component.size();
        let mut values = match accessor.buffer_view {
            None => vec![0.0; count * width],
            Some(view) => {
                let (bytes, layout) = self
                    .view(view, accessor.byte_offset, size, count, true)
                    .ok_or_else(|| bad("it does not lie within its buffer"))?;
                numbers(bytes, layout, component, scale)
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let Checked::Valid(index_type) = sparse.indices.component_type else {
                return Err(bad("unknown type of sparse indices"));
            };
            let outside = || bad("its sparse part does not lie within its buffer");
            let changed = self.bounded(sparse.count).ok_or_else(outside)?;
            let (bytes, layout) = self
                .view(
                    sparse.indices.buffer_view,
                    Some(sparse.indices.byte_offset),
                    index_type.0.size(),
                    changed,
                    false,
                )
                .ok_or_else(outside)?;
            let indices = numbers(bytes, layout, index_type.0, 1.0);
            let (bytes, layout) = self
                .view(
                    sparse.values.buffer_view,
                    Some(sparse.values.byte_offset),
                    size,
                    changed,
                    false,
                )
                .ok_or_else(outside)?;
            let replacements = numbers(bytes, layout, component, scale);
            for (i, new) in indices.iter().zip(replacements.chunks_exact(width)) {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "was an unsigned integer of at most 32 bits"
                )]
                let at = *i as usize * width;
                let old = values
                    .get_mut(at..at + width)
                    .ok_or_else(|| bad("a sparse index is out of range"))?;
                old.copy_from_slice(new);
            }
        }
        Ok(Elements { values, width })
    }

    /// Reads vertex indices.
    pub(super) fn indices(&self, index: Index<Accessor>) -> Result<Vec<u32>, ParseError> {
        let accessor = self.accessor(index)?;
        let bad = |cause: &str| fault(format!("accessor {}: {cause}", index.value()));
        let integers = match accessor.component_type {
            Checked::Valid(c) => matches!(
                c.0,
                ComponentType::U8 | ComponentType::U16 | ComponentType::U32
            ),
            Checked::Invalid => false,
        };
        if !integers
            || !matches!(accessor.type_, Checked::Valid(Type::Scalar))
            || accessor.normalized
        {
            return Err(bad("indices must be unsigned integers"));
        }
        let elements = self.elements(index)?;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "were unsigned integers of at most 32 bits"
        )]
        let indices = elements.values.iter().map(|&v| v as u32).collect();
        Ok(indices)
    }

    /// A count that the buffers could hold at one byte an element.
    fn bounded(&self, count: USize64) -> Option<usize> {
        (count.0 <= self.total_bytes)
            .then(|| usize::try_from(count.0).ok())
            .flatten()
    }

    fn view(
        &self,
        view: Index<buffer::View>,
        offset: Option<USize64>,
        size: usize,
        count: usize,
        strided: bool,
    ) -> Option<(&[u8], Layout)> {
        let view = self.root.buffer_views.get(view.value())?;
        let buffer = self.buffers.get(view.buffer.value())?;
        let start = usize::try_from(view.byte_offset.map_or(0, |o| o.0)).ok()?;
        let length = usize::try_from(view.byte_length.0).ok()?;
        let bytes = buffer.get(start..start.checked_add(length)?)?;
        let offset = usize::try_from(offset.map_or(0, |o| o.0)).ok()?;
        let stride = match view.byte_stride {
            Some(stride) if strided && stride.0 > 0 => stride.0,
            _ => size,
        };
        let end = match count.checked_sub(1) {
            None => offset,
            Some(gaps) => gaps
                .checked_mul(stride)?
                .checked_add(size)?
                .checked_add(offset)?,
        };
        (end <= bytes.len()).then_some((
            bytes,
            Layout {
                offset,
                stride,
                size,
                count,
            },
        ))
    }
}

/// What a normalized integer is multiplied by.
fn unit_scale(component: ComponentType) -> f64 {
    match component {
        ComponentType::I8 => 1.0 / 127.0,
        ComponentType::U8 => 1.0 / 255.0,
        ComponentType::I16 => 1.0 / 32767.0,
        ComponentType::U16 => 1.0 / 65535.0,
        ComponentType::U32 => 1.0 / 4_294_967_295.0,
        ComponentType::F32 => 1.0,
    }
}

fn numbers(bytes: &[u8], layout: Layout, component: ComponentType, scale: f64) -> Vec<f64> {
    let Layout {
        offset,
        stride,
        size,
        count,
    } = layout;
    let mut out = Vec::with_capacity(count * size / component.size());
    for i in 0..count {
        let start = offset + i * stride;
        for c in bytes[start..start + size].chunks_exact(component.size()) {
            let value = match (component, c) {
                (ComponentType::I8, &[a]) => f64::from(a.cast_signed()),
                (ComponentType::U8, &[a]) => f64::from(a),
                (ComponentType::I16, &[a, b]) => f64::from(i16::from_le_bytes([a, b])),
                (ComponentType::U16, &[a, b]) => f64::from(u16::from_le_bytes([a, b])),
                (ComponentType::U32, &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
                (ComponentType::F32, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
                _ => f64::NAN,
            };
            let signed = matches!(component, ComponentType::I8 | ComponentType::I16);
            // The specification maps both −127 and −128 to −1.
            out.push(if signed && scale < 1.0 {
                (value * scale).max(-1.0)
            } else {
                value * scale
            });
        }
    }
    out
}
