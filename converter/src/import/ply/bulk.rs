//! Reading the records of an element in parallel, where all have the same shape.
//!
//! The first record tells how long the lists are. If every other record has lists of the same lengths (and, in ASCII, a line
//! of its own), the place of each value is known and records are read independently of one another. Anything else, faults
//! among it, is left to the reader that goes value by value and knows what to say.

use super::body::{Ascii, Binary, Body, decode};
use super::header::{Element, Scalar};
use crate::import::text::{count_lines, line_chunks, number, words};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// More values a record than any mesh has.
const MAX_COLUMNS: usize = 256;
/// Records that a thread takes at once.
const RECORDS: usize = 4096;

/// One value of a record.
#[derive(Debug, Clone, Copy)]
pub(super) struct Column {
    scalar: Scalar,
    /// The length of a list: all records must agree.
    must_be: Option<f64>,
}

/// What a record of `element` looks like, judging by the first; and for each property where its values begin.
pub(super) fn shape(
    element: &Element,
    body: &(impl Body + Clone),
) -> Option<(Vec<Column>, Vec<usize>)> {
    let mut body = body.clone();
    let (mut columns, mut starts) = (Vec::new(), Vec::new());
    for property in &element.properties {
        let length = match property.list {
            None => 1,
            Some(scalar) => {
                let length = body.list_length(scalar, property.scalar).ok()?;
                columns.push(Column {
                    scalar,
                    must_be: Some(length as f64),
                });
                usize::try_from(length).ok()?
            }
        };
        if length > MAX_COLUMNS - columns.len().min(MAX_COLUMNS) {
            return None;
        }
        starts.push(columns.len());
        for _ in 0..length {
            body.scalar(property.scalar).ok()?;
            columns.push(Column {
                scalar: property.scalar,
                must_be: None,
            });
        }
    }
    (!columns.is_empty()).then_some((columns, starts))
}

/// A body that may know where each record begins.
pub(super) trait Bulk: Body + Clone {
    /// `make` of the values of each of `count` records, if all are as `columns` say and `make` accepts them; the body then goes on
    /// after them. Else nothing has changed.
    fn rows<T: Send + Default>(
        &mut self,
        count: usize,
        columns: &[Column],
        make: impl Fn(&[f64]) -> Option<T> + Sync,
    ) -> Option<Vec<T>>;
}

impl<const BIG_ENDIAN: bool> Bulk for Binary<'_, BIG_ENDIAN> {
    fn rows<T: Send + Default>(
        &mut self,
        count: usize,
        columns: &[Column],
        make: impl Fn(&[f64]) -> Option<T> + Sync,
    ) -> Option<Vec<T>> {
        let stride: usize = columns.iter().map(|c| c.scalar.size()).sum();
        let length = count.checked_mul(stride)?;
        let failed = AtomicBool::new(false);
        let rows = self
            .rest()
            .get(..length)?
            .par_chunks_exact(stride)
            .with_min_len(RECORDS)
            .map_init(
                || vec![0.0; columns.len()],
                |values, record| {
                    let row = read_record::<BIG_ENDIAN>(record, columns, values)
                        .and_then(|()| make(values));
                    row.unwrap_or_else(|| {
                        failed.store(true, Ordering::Relaxed);
                        T::default()
                    })
                },
            )
            .collect();
        if failed.into_inner() {
            return None;
        }
        self.skip(length);
        Some(rows)
    }
}

fn read_record<const BIG_ENDIAN: bool>(
    mut record: &[u8],
    columns: &[Column],
    values: &mut [f64],
) -> Option<()> {
    for (column, value) in columns.iter().zip(values) {
        let (bytes, rest) = record.split_at_checked(column.scalar.size())?;
        record = rest;
        *value = decode::<BIG_ENDIAN>(column.scalar, bytes)?;
        if column
            .must_be
            .is_some_and(|n| n.to_bits() != value.to_bits())
        {
            return None;
        }
    }
    Some(())
}

impl Bulk for Ascii<'_> {
    fn rows<T: Send + Default>(
        &mut self,
        count: usize,
        columns: &[Column],
        make: impl Fn(&[f64]) -> Option<T> + Sync,
    ) -> Option<Vec<T>> {
        let mut left = count;
        let mut chunks = line_chunks(self.next_words());
        let lines: Vec<usize> = chunks.par_iter().map(|chunk| count_lines(chunk)).collect();
        let whole = lines.iter().take_while(|&&n| {
            let fits = n <= left;
            left -= if fits { n } else { 0 };
            fits
        });
        let whole = whole.count();
        if let Some(last) = chunks.get_mut(whole).filter(|_| left > 0) {
            let end = last
                .iter()
                .enumerate()
                .filter(|(_, b)| **b == b'\n')
                .nth(left - 1)
                .map_or(last.len(), |(i, _)| i + 1);
            *last = &last[..end];
            chunks.truncate(whole + 1);
        } else {
            chunks.truncate(whole);
        }
        let read = |chunk: &&[u8]| -> Option<Vec<T>> {
            let mut values = vec![0.0; columns.len()];
            chunk
                .strip_suffix(b"\n")
                .unwrap_or(chunk)
                .split(|&b| b == b'\n')
                .map(|line| {
                    read_line(line, columns, &mut values)?;
                    make(&values)
                })
                .collect()
        };
        let parts: Vec<Vec<T>> = chunks.par_iter().map(read).collect::<Option<_>>()?;
        let mut rows = Vec::with_capacity(count);
        for part in parts {
            rows.extend(part);
        }
        if rows.len() != count {
            return None;
        }
        // Up to the last word, as if it had been read by itself.
        let length: usize = chunks.iter().map(|chunk| chunk.len()).sum();
        let lines: usize = chunks.iter().map(|chunk| count_lines(chunk)).sum();
        let ended = usize::from(chunks.last().is_some_and(|chunk| chunk.ends_with(b"\n")));
        self.skip(length - ended, (lines - ended) as u64);
        Some(rows)
    }
}

fn read_line(line: &[u8], columns: &[Column], values: &mut [f64]) -> Option<()> {
    let mut words = words(line);
    for (column, value) in columns.iter().zip(values) {
        *value = number(words.next()?, crate::error::Place::File, "").ok()?;
        if column
            .must_be
            .is_some_and(|n| n.to_bits() != value.to_bits())
        {
            return None;
        }
    }
    words.next().is_none().then_some(())
}
