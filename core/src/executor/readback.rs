//! A ring of staging buffers through which the GPU's results reach the CPU.

use std::sync::{
    Arc,
    atomic::{AtomicU8, Ordering},
};

use super::{Gpu, RunError};

const IDLE: u8 = 0;
const RECORDED: u8 = 1;
const MAPPING: u8 = 2;
const MAPPED: u8 = 3;
const FAILED: u8 = 4;

struct Entry {
    buffer: wgpu::Buffer,
    state: Arc<AtomicU8>,
    frame: u64,
}

/// A ring of equal buffers, one for each frame in flight.
pub(super) struct Readback {
    entries: Vec<Entry>,
    /// Frames run by the executors that owned it before.
    before: u64,
}

impl Readback {
    pub fn new(device: &wgpu::Device, bytes: u64, count: usize) -> Self {
        let entry = || Entry {
            buffer: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("readback"),
                size: bytes.max(16),
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            }),
            state: Arc::new(AtomicU8::new(IDLE)),
            frame: 0,
        };
        Self { entries: (0..count).map(|_| entry()).collect(), before: 0 }
    }

    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Takes another executor's ring, with its pending readbacks; `frames` is the number of frames that executor has
    /// run. It continues with an empty ring. Nothing happens if the lengths differ.
    pub fn take_over(&mut self, other: &mut Self, frames: u64) {
        if self.len() == other.len() {
            std::mem::swap(self, other);
            self.before += frames;
        }
    }

    /// The buffer to copy this frame's result into. An old result that nobody read is dropped.
    pub fn record(&mut self, frame: u64) -> &wgpu::Buffer {
        let (count, frame) = (self.entries.len() as u64, self.before + frame);
        let entry = &mut self.entries[(frame % count) as usize];
        if matches!(entry.state.load(Ordering::Acquire), MAPPING | MAPPED) {
            entry.buffer.unmap();
        }
        // A fresh flag: the callback of a dropped mapping must not set it.
        entry.state = Arc::new(AtomicU8::new(RECORDED));
        entry.frame = frame;
        &entry.buffer
    }

    /// Requests the mapping of the recorded buffers; call it after the submission.
    pub fn map(&mut self) {
        for entry in &self.entries {
            if entry.state.compare_exchange(RECORDED, MAPPING, Ordering::AcqRel, Ordering::Acquire).is_ok() {
                let state = entry.state.clone();
                entry.buffer.map_async(wgpu::MapMode::Read, .., move |result| {
                    state.store(if result.is_ok() { MAPPED } else { FAILED }, Ordering::Release);
                });
            }
        }
    }

    /// Passes `frame`'s bytes to `read`, waiting for them if they are still pending. Does nothing if that frame was not
    /// recorded.
    pub fn take(&mut self, gpu: &Gpu, frame: u64, read: impl FnOnce(&[u8])) -> Result<(), RunError> {
        self.take_late(gpu, frame, 0, read)
    }

    /// The same with the bytes of an earlier frame, this many before `frame`; it may be another executor's.
    pub fn take_late(
        &mut self,
        gpu: &Gpu,
        frame: u64,
        late: u64,
        read: impl FnOnce(&[u8]),
    ) -> Result<(), RunError> {
        let Some(frame) = (self.before + frame).checked_sub(late) else { return Ok(()) };
        let count = self.entries.len() as u64;
        let entry = &mut self.entries[(frame % count) as usize];
        if entry.frame != frame || entry.state.load(Ordering::Acquire) < MAPPING {
            return Ok(());
        }
        // Another thread that polls the same device may still be running our callback after the wait.
        while entry.state.load(Ordering::Acquire) == MAPPING {
            gpu.wait()?;
            std::thread::yield_now();
        }
        if entry.state.load(Ordering::Acquire) != MAPPED {
            gpu.check()?;
            return Err(RunError::Gpu("a readback could not be mapped".into()));
        }
        let range = entry.buffer.get_mapped_range(..).map_err(|error| RunError::Gpu(error.to_string()))?;
        read(&range);
        // It stays mapped until the next recording: a failed frame may be run again and read the same bytes.
        Ok(())
    }
}
