//! The tracer on its own threads: callers submit requests and collect finished samples without waiting.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use super::{Hit, Job, TraceSettings, Tracer};

/// Maximum number of batches in the queue. With one batch per frame, a request waits for at most this many frames.
const MAX_WAITING: usize = 3;

/// Number of jobs that a worker takes at a time: at most a millisecond of work with a few light paths per sample.
const CHUNK: usize = 64;

/// A request with a tag that identifies the answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaggedJob<T> {
    /// The request.
    pub job: Job,
    /// Returned with the answer.
    pub tag: T,
}

/// An answer with the tag of its request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaggedHit<T> {
    /// The sample.
    pub hit: Hit,
    /// The tag of the request.
    pub tag: T,
}

/// Worker threads that trace batches of requests in order of submission. Dropping this value ends the threads.
pub struct AsyncTracer<T> {
    shared: Arc<Shared<T>>,
    workers: Vec<JoinHandle<()>>,
}

struct Shared<T> {
    state: Mutex<State<T>>,
    /// Signalled when there is work, or on shutdown.
    changed: Condvar,
    finished: Mutex<VecDeque<TaggedHit<T>>>,
}

struct State<T> {
    waiting: VecDeque<Batch<T>>,
    stop: bool,
}

struct Batch<T> {
    tracer: Arc<Tracer>,
    jobs: Vec<TaggedJob<T>>,
    /// Index of the first job that no worker has taken.
    next: usize,
    settings: TraceSettings,
    seed: u64,
}

impl<T: Copy + Send + 'static> AsyncTracer<T> {
    /// Starts `workers` threads, at least one.
    pub fn new(workers: usize) -> Self {
        let shared = Arc::new(Shared {
            state: Mutex::new(State { waiting: VecDeque::new(), stop: false }),
            changed: Condvar::new(),
            finished: Mutex::new(VecDeque::new()),
        });
        let workers = (0..workers.max(1))
            .map(|_| {
                let shared = shared.clone();
                std::thread::spawn(move || shared.work())
            })
            .collect();
        Self { shared, workers }
    }

    /// Queues a batch for `tracer` and returns at once. If the workers fall behind, the oldest batches that no worker
    /// has begun are dropped. Returns the number of dropped jobs.
    pub fn submit(
        &self,
        tracer: &Arc<Tracer>,
        jobs: Vec<TaggedJob<T>>,
        settings: TraceSettings,
        seed: u64,
    ) -> usize {
        let mut state = lock(&self.shared.state);
        state.waiting.push_back(Batch { tracer: tracer.clone(), jobs, next: 0, settings, seed });
        let mut dropped = 0;
        while state.waiting.iter().filter(|batch| batch.next == 0).count() > MAX_WAITING {
            let oldest = state.waiting.iter().position(|batch| batch.next == 0);
            dropped += oldest.and_then(|i| state.waiting.remove(i)).map_or(0, |batch| batch.jobs.len());
        }
        drop(state);
        self.shared.changed.notify_all();
        dropped
    }

    /// Appends at most `max` finished samples to `into`, oldest first, without waiting.
    pub fn collect(&self, max: usize, into: &mut Vec<TaggedHit<T>>) {
        let mut finished = lock(&self.shared.finished);
        let count = max.min(finished.len());
        into.extend(finished.drain(..count));
    }

    /// The number of jobs waiting for a worker.
    pub fn waiting(&self) -> usize {
        lock(&self.shared.state).waiting.iter().map(|batch| batch.jobs.len() - batch.next).sum()
    }
}

impl<T: Copy> Shared<T> {
    /// The loop of a worker thread.
    fn work(&self) {
        let mut chunk = Vec::with_capacity(CHUNK);
        let mut hits = Vec::with_capacity(CHUNK);
        while let Some((tracer, settings, seed)) = self.take(&mut chunk) {
            hits.extend(chunk.drain(..).map(|TaggedJob { job, tag }: TaggedJob<T>| {
                let hit = tracer.trace_job(&job, &settings, seed);
                TaggedHit { hit, tag }
            }));
            lock(&self.finished).extend(hits.drain(..));
        }
    }

    /// Waits for work and moves some of it to `chunk`; `None` on shutdown.
    fn take(&self, chunk: &mut Vec<TaggedJob<T>>) -> Option<(Arc<Tracer>, TraceSettings, u64)> {
        let idle = |state: &mut State<T>| !state.stop && state.waiting.is_empty();
        let mut state =
            self.changed.wait_while(lock(&self.state), idle).unwrap_or_else(PoisonError::into_inner);
        if state.stop {
            return None;
        }
        let batch = state.waiting.front_mut()?;
        let end = (batch.next + CHUNK).min(batch.jobs.len());
        chunk.extend_from_slice(&batch.jobs[batch.next..end]);
        batch.next = end;
        let how = (batch.tracer.clone(), batch.settings, batch.seed);
        if end == batch.jobs.len() {
            state.waiting.pop_front();
        }
        Some(how)
    }
}

impl<T> Drop for AsyncTracer<T> {
    fn drop(&mut self) {
        lock(&self.shared.state).stop = true;
        self.shared.changed.notify_all();
        for worker in self.workers.drain(..) {
            // If a worker has panicked, the panic was already printed to stderr.
            let _ = worker.join();
        }
    }
}

/// Locks even if another thread panicked: no critical section here can leave a change unfinished.
fn lock<S>(mutex: &Mutex<S>) -> MutexGuard<'_, S> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
