//! Reading back without waiting: a ring of staging buffers, mapped when the copy into them has run.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use tumble_core::{Error, Result};
use wgpu::{BufferUsages, CommandEncoder, MapMode, PollType, SubmissionIndex};

use crate::device::Gpu;

/// How long a copy that has run may take to be told of: its callback may be in another thread's hands.
const PATIENCE: Duration = Duration::from_secs(10);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Pending,
    Mapped,
    Failed,
    /// The commands were dropped before they were submitted.
    Dropped,
}

/// What became of a mapping. The callback runs in whichever thread polls the device first.
#[derive(Debug)]
struct Arrival {
    state: Mutex<State>,
    changed: Condvar,
}

impl Arrival {
    fn set(&self, state: State) {
        let mut current = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if *current == State::Pending {
            *current = state;
            self.changed.notify_all();
        }
    }

    fn state(&self) -> State {
        *self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait(&self) {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        // An answer later than that reads as none.
        drop(self.changed.wait_timeout_while(state, PATIENCE, |state| *state == State::Pending));
    }
}

/// Held by the callback: a callback that is dropped unheard says so.
struct Signal(Arc<Arrival>);

impl Drop for Signal {
    fn drop(&mut self) {
        self.0.set(State::Dropped);
    }
}

/// Copies of a small buffer on their way to the host, oldest first.
#[derive(Debug)]
pub struct Readback {
    name: String,
    bytes: u64,
    free: Vec<wgpu::Buffer>,
    flying: VecDeque<Flight>,
}

#[derive(Debug)]
struct Flight {
    buffer: wgpu::Buffer,
    arrival: Arc<Arrival>,
    submission: Option<SubmissionIndex>,
}

impl Readback {
    /// Room for `slots` copies of `bytes` bytes each (a multiple of 4) in flight at once.
    ///
    /// # Errors
    /// As for [`Gpu::create_buffer`].
    pub fn new(gpu: &Gpu, name: &str, bytes: u64, slots: usize) -> Result<Self> {
        let usage = BufferUsages::COPY_DST | BufferUsages::MAP_READ;
        let free = (0..slots).map(|_| gpu.create_buffer(name, bytes, usage)).collect::<Result<_>>()?;
        Ok(Self { name: name.to_owned(), bytes, free, flying: VecDeque::with_capacity(slots) })
    }

    /// Copies in flight or not yet taken.
    pub fn in_flight(&self) -> usize {
        self.flying.len()
    }

    /// Whether every slot is in flight or not yet taken.
    pub fn is_full(&self) -> bool {
        self.free.is_empty()
    }

    /// Records a copy of the first bytes of `source` from `offset` on, to be mapped once the encoder's commands have
    /// run. Returns false, and records nothing, when every slot is taken.
    pub fn copy(&mut self, encoder: &mut CommandEncoder, source: &wgpu::Buffer, offset: u64) -> bool {
        let Some(buffer) = self.free.pop() else { return false };
        encoder.copy_buffer_to_buffer(source, offset, &buffer, 0, self.bytes);
        let arrival = Arc::new(Arrival { state: Mutex::new(State::Pending), changed: Condvar::new() });
        let signal = Signal(Arc::clone(&arrival));
        encoder.map_buffer_on_submit(&buffer, MapMode::Read, .., move |result| {
            signal.0.set(if result.is_ok() { State::Mapped } else { State::Failed });
        });
        self.flying.push_back(Flight { buffer, arrival, submission: None });
        true
    }

    /// Tells in which submission the copies recorded since the last call went out: [`Readback::wait_take`] waits for
    /// that one and for no later one, and not at all for a copy of which it was not told.
    pub fn submitted(&mut self, index: &SubmissionIndex) {
        for flight in self.flying.iter_mut().filter(|flight| flight.submission.is_none()) {
            flight.submission = Some(index.clone());
        }
    }

    /// The oldest copy, when it has arrived. Does not wait.
    ///
    /// # Errors
    /// [`Error::DeviceLost`] when the copy will never arrive.
    pub fn try_take(&mut self, gpu: &Gpu) -> Result<Option<Vec<u8>>> {
        if self.flying.is_empty() {
            return Ok(None);
        }
        gpu.poll(PollType::Poll)?;
        self.take(gpu)
    }

    /// The oldest copy, waited for; `None` when none is in flight.
    ///
    /// # Errors
    /// [`Error::DeviceLost`] when the copy will never arrive, [`Error::Gpu`] when it was never submitted.
    pub fn wait_take(&mut self, gpu: &Gpu) -> Result<Option<Vec<u8>>> {
        let Some(flight) = self.flying.front() else { return Ok(None) };
        if flight.submission.is_some() {
            gpu.poll(PollType::Wait { submission_index: flight.submission.clone(), timeout: None })?;
            flight.arrival.wait();
        }
        match self.take(gpu)? {
            Some(bytes) => Ok(Some(bytes)),
            None => {
                self.drop_oldest(gpu);
                Err(Error::Gpu { what: format!("read-back of `{}`", self.name), message: "it never arrived".into() })
            }
        }
    }

    fn take(&mut self, gpu: &Gpu) -> Result<Option<Vec<u8>>> {
        let Some(flight) = self.flying.front() else { return Ok(None) };
        match flight.arrival.state() {
            State::Pending => Ok(None),
            State::Mapped => {
                let view = flight.buffer.get_mapped_range(..self.bytes);
                let bytes = view.map(|view| view.to_vec());
                flight.buffer.unmap();
                if let Some(flight) = self.flying.pop_front() {
                    self.free.push(flight.buffer);
                }
                let what = || format!("read-back of `{}`", self.name);
                bytes.map(Some).map_err(|error| Error::Gpu { what: what(), message: error.to_string() })
            }
            State::Dropped => {
                self.drop_oldest(gpu);
                let what = format!("read-back of `{}`", self.name);
                Err(Error::Gpu { what, message: "its commands were never submitted".into() })
            }
            State::Failed => {
                self.drop_oldest(gpu);
                gpu.check()?;
                Err(Error::DeviceLost { reason: format!("the read-back of `{}` could not be mapped", self.name) })
            }
        }
    }

    /// Gives up the oldest copy. Its buffer may still be asked for by the device, so a new one takes its slot.
    fn drop_oldest(&mut self, gpu: &Gpu) {
        self.flying.pop_front();
        let usage = BufferUsages::COPY_DST | BufferUsages::MAP_READ;
        self.free.extend(gpu.create_buffer(&self.name, self.bytes, usage));
    }
}

/// Reads `bytes` bytes of `source` from `offset` on (multiples of 4), and waits for them.
///
/// # Errors
/// As for [`Gpu::create_buffer`] and [`Readback::wait_take`].
pub fn read_now(gpu: &Gpu, source: &wgpu::Buffer, offset: u64, bytes: u64) -> Result<Vec<u8>> {
    let [read] = read_parts(gpu, [(source, offset, bytes)])?;
    Ok(read)
}

/// Reads parts of buffers, each given with its first byte and its bytes (multiples of 4), in one submission, and waits
/// for them.
pub(crate) fn read_parts<const N: usize>(gpu: &Gpu, parts: [(&wgpu::Buffer, u64, u64); N]) -> Result<[Vec<u8>; N]> {
    let mut read = [const { Vec::new() }; N];
    let wanted = parts.iter().map(|&(.., bytes)| (bytes > 0).then(|| Readback::new(gpu, "read", bytes, 1)).transpose());
    let mut readbacks = wanted.collect::<Result<Vec<_>>>()?;
    if readbacks.iter().all(Option::is_none) {
        return Ok(read);
    }
    let index = gpu.scoped("a read-back", || {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for (readback, (source, offset, _)) in readbacks.iter_mut().zip(parts) {
            if let Some(readback) = readback {
                readback.copy(&mut encoder, source, offset);
            }
        }
        gpu.queue.submit([encoder.finish()])
    })?;
    for (readback, read) in readbacks.iter_mut().zip(&mut read) {
        if let Some(readback) = readback {
            readback.submitted(&index);
            *read = readback.wait_take(gpu)?.unwrap_or_default();
        }
    }
    Ok(read)
}
