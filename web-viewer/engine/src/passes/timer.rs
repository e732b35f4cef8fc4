//! How long the GPU takes for a frame, where the device has timestamp queries.

use std::sync::mpsc::channel;

/// Two timestamps, around one render pass.
#[derive(Debug)]
pub struct GpuTimer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
    period_ns: f64,
}

impl GpuTimer {
    const BYTES: u64 = 2 * wgpu::QUERY_SIZE as u64;

    /// A timer; `None` where the device was not made with [`wgpu::Features::TIMESTAMP_QUERY`].
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Option<Self> {
        if !device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let buffer = |usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: Self::BYTES,
                usage,
                mapped_at_creation: false,
            })
        };
        Some(Self {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("frame"),
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            readable: buffer(wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ),
            period_ns: f64::from(queue.get_timestamp_period()),
        })
    }

    /// For the descriptor of a pass to be timed: whether the clock starts with it, and stops after it.
    pub fn writes(
        &self,
        is_first: bool,
        is_last: bool,
    ) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        (is_first || is_last).then(|| wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: is_first.then_some(0),
            end_of_pass_write_index: is_last.then_some(1),
        })
    }

    /// After the pass.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.queries, 0..2, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readable, 0, Self::BYTES);
    }

    /// Milliseconds that the pass took; waits until it is done. `None` where waiting is not possible (browsers) or the
    /// clock makes no sense.
    pub fn wait_ms(&self, device: &wgpu::Device) -> Option<f64> {
        let (sender, receiver) = channel();
        self.readable
            .slice(..)
            .map_async(wgpu::MapMode::Read, move |result| {
                // Nobody listens where waiting is not possible.
                let _ = sender.send(result.is_ok());
            });
        device.poll(wgpu::PollType::wait_indefinitely()).ok()?;
        let ticks = receiver
            .try_recv()
            .ok()
            .filter(|mapped| *mapped)
            .and_then(|_| {
                let mapped = self.readable.slice(..).get_mapped_range().ok()?;
                let (start, end) = mapped.split_at_checked(size_of::<u64>())?;
                let [start, end] =
                    [start, end].map(|bytes| bytes.try_into().ok().map(u64::from_le_bytes));
                end?.checked_sub(start?)
            });
        self.readable.unmap();
        ticks.map(|ticks| ticks as f64 * self.period_ns * 1e-6)
    }
}
