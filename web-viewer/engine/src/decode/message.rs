//! Image jobs and their results as bytes.
//!
//! A job: width, height, margin and the number of mips left out, 32 bits each, the lowest byte first; then the frame. A result:
//! the texels of the mips, fine to coarse; their sizes follow from the job.

use super::{DecodeJob, DecodeResult, Decoded, ImageWork, Work};
use crate::colour::slots::MIPS;
use crate::colour::upload::Mip;
use marquetry_format::ImageTask;

const FIELDS: usize = 4;

impl DecodeJob {
    /// The job as bytes for [`run_message`]; `None` for one that is no image.
    pub fn message(&self) -> Option<Vec<u8>> {
        let Work::Image(work) = &self.work else {
            return None;
        };
        let ImageTask {
            width,
            height,
            frame,
        } = &work.task;
        let fields: [u32; FIELDS] = [*width, *height, work.margin, u32::from(work.skipped)];
        let mut message: Vec<u8> = fields.into_iter().flat_map(u32::to_le_bytes).collect();
        message.extend_from_slice(frame);
        Some(message)
    }

    /// What [`run_message`] made of this job.
    pub fn read_result(&self, message: &[u8]) -> DecodeResult {
        let decoded = match &self.work {
            Work::Image(work) => work.mips_of(message).map(Decoded::Image),
            Work::Page(_) => None,
        };
        DecodeResult {
            id: self.id,
            decoded: decoded.ok_or_else(|| "a worker answered with something else".to_owned()),
        }
    }
}

impl ImageWork {
    fn mips_of(&self, message: &[u8]) -> Option<Vec<Mip>> {
        let mut rest: &[[u8; 4]] = bytemuck::try_cast_slice(message).ok()?;
        let side = |texels: u32, mip: u32| (texels + 2 * self.margin) >> mip;
        let mips = (u32::from(self.skipped).min(MIPS - 1)..MIPS).map(|mip| {
            let [width, height] = [self.task.width, self.task.height].map(|k| side(k, mip));
            let count = usize::try_from(width * height).ok()?;
            let (rgba, after) = rest.split_at_checked(count)?;
            rest = after;
            let rgba = rgba.to_vec();
            Some(Mip {
                width,
                height,
                rgba,
            })
        });
        let mips = mips.collect::<Option<Vec<_>>>()?;
        rest.is_empty().then_some(mips)
    }
}

/// Does what the message of a job says; the message of its result, for [`DecodeJob::read_result`].
///
/// # Errors
/// Why the image does not decode, in words.
pub fn run_message(message: &[u8]) -> Result<Vec<u8>, String> {
    let (fields, frame) = message
        .split_first_chunk::<{ 4 * FIELDS }>()
        .ok_or("the job is too short")?;
    let field = |index: usize| {
        let bytes = fields.as_chunks().0.get(index).copied();
        u32::from_le_bytes(bytes.unwrap_or_default())
    };
    let work = ImageWork {
        task: ImageTask {
            width: field(0),
            height: field(1),
            frame: frame.to_vec(),
        },
        margin: field(2),
        skipped: u8::try_from(field(3)).unwrap_or(u8::MAX),
    };
    let mips = work.run().map_err(|error| error.to_string())?;
    Ok(mips
        .iter()
        .flat_map(|mip| bytemuck::cast_slice::<_, u8>(&mip.rgba))
        .copied()
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decode::JobId;

    fn job(margin: u32, skipped: u8) -> DecodeJob {
        let frame = include_bytes!("../../../../format/tests/data/texture_16x24.vp8").to_vec();
        let task = ImageTask {
            width: 16,
            height: 24,
            frame,
        };
        DecodeJob {
            id: JobId(7),
            work: Work::Image(ImageWork {
                task,
                margin,
                skipped,
            }),
        }
    }

    #[test]
    fn a_message_brings_the_same_texels() {
        for (margin, skipped) in [(0, 0), (0, 2), (8, 0)] {
            let job = job(margin, skipped);
            let answer = run_message(&job.message().unwrap()).unwrap();
            let (sent, here) = (job.read_result(&answer), job.run());
            assert_eq!(sent.id, here.id);
            let (Ok(Decoded::Image(sent)), Ok(Decoded::Image(here))) = (sent.decoded, here.decoded)
            else {
                panic!("both are images");
            };
            assert_eq!(sent, here);
            assert_eq!(here.len(), 4 - usize::from(skipped));
        }
    }

    #[test]
    fn damage_is_said_in_words() {
        let job = job(0, 0);
        let message = job.message().unwrap();
        for length in [0, 15, 16, 20, message.len() / 2] {
            let answer = run_message(&message[..length]);
            // A frame that ends early may still decode: to something of the right size.
            assert!(answer.is_err() || job.read_result(&answer.unwrap()).decoded.is_ok());
        }
        let answer = run_message(&message).unwrap();
        for wrong in [&answer[..answer.len() - 4], &answer[..5], &[]] {
            assert!(job.read_result(wrong).decoded.is_err());
        }
    }
}
