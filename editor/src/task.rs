//! Work that takes too long for the window's thread.

use std::{
    sync::mpsc::{self, TryRecvError},
    thread,
    time::{Duration, Instant},
};

use egui::Context;

/// Runs one piece of work at a time on a thread of its own. A key identifies the work; the newest result is kept.
pub struct Task<K, T> {
    running: Option<Running<K, T>>,
    /// The last finished key and its result. The result is `None` if it was taken or the work panicked; it is not
    /// retried.
    done: Option<(K, Option<T>)>,
    /// Work that is shorter than this needs no rest.
    free: Duration,
    /// No new work starts before this time, so that other threads get the cores.
    rest: Option<Instant>,
    /// True if the last wanted key is not done yet.
    behind: bool,
}

struct Running<K, T> {
    key: K,
    since: Instant,
    result: mpsc::Receiver<T>,
}

impl<K, T> Default for Task<K, T> {
    fn default() -> Self {
        Self { running: None, done: None, free: Duration::ZERO, rest: None, behind: false }
    }
}

impl<K: PartialEq, T: Send + 'static> Task<K, T> {
    /// A task that rests only after work that took longer than `free`.
    pub fn free(free: Duration) -> Self {
        Self { free, ..Self::default() }
    }

    /// Starts work for a key, unless its result is finished or other work is running. Call it in every frame of the
    /// window while a result is needed. Repeated work takes at most half of the time, unless it is shorter than `free`.
    pub fn want(&mut self, context: &Context, key: K, work: impl FnOnce() -> T + Send + 'static) {
        self.poll();
        self.want_after_take(context, key, work);
    }

    /// Like [`Self::want`], for work that builds on the last taken result: it does not replace a result that was not
    /// taken.
    pub fn want_after_take(&mut self, context: &Context, key: K, work: impl FnOnce() -> T + Send + 'static) {
        self.behind = self.done().is_none_or(|done| *done != key);
        if self.running.is_some() || !self.behind {
            return;
        }
        let rest = self.rest.map_or(Duration::ZERO, |rest| rest.saturating_duration_since(Instant::now()));
        if !rest.is_zero() {
            context.request_repaint_after(rest);
            return;
        }
        let (tell, result) = mpsc::channel();
        let woken = context.clone();
        let started = thread::Builder::new().name("viewer".into()).spawn(move || {
            // The receiver may be gone.
            let _ = tell.send(work());
            drop(tell);
            woken.request_repaint();
        });
        if started.is_ok() {
            self.running = Some(Running { key, since: Instant::now(), result });
        }
    }

    /// The newest result, and its key.
    pub fn result(&self) -> Option<(&K, &T)> {
        let (key, result) = self.done.as_ref()?;
        Some((key, result.as_ref()?))
    }

    /// The newest result; returned once.
    pub fn take(&mut self) -> Option<T> {
        self.poll();
        self.done.as_mut()?.1.take()
    }

    /// The key of the finished result.
    pub fn done(&self) -> Option<&K> {
        self.done.as_ref().map(|(key, _)| key)
    }

    /// Skips the rest before the next work.
    pub fn hurry(&mut self) {
        self.rest = None;
    }

    /// True if the last wanted key is not done yet.
    pub fn is_behind(&self) -> bool {
        self.behind
    }

    /// True if work is under way.
    pub fn is_busy(&self) -> bool {
        self.running.is_some()
    }

    fn poll(&mut self) {
        let Some(running) = &self.running else { return };
        let result = match running.result.try_recv() {
            Ok(result) => Some(result),
            Err(TryRecvError::Disconnected) => None,
            Err(TryRecvError::Empty) => return,
        };
        if let Some(Running { key, since, .. }) = self.running.take() {
            self.rest = Some(Instant::now() + since.elapsed().saturating_sub(self.free));
            self.done = Some((key, result));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wait(task: &mut Task<u32, u32>, key: u32, work: fn(u32) -> u32) {
        let start = Instant::now();
        while task.done.as_ref().is_none_or(|(done, _)| *done != key) {
            task.want(&Context::default(), key, move || work(key));
            assert!(start.elapsed() < Duration::from_secs(60));
            thread::yield_now();
        }
    }

    #[test]
    fn the_newest_result_stays_until_the_next_is_finished() {
        let mut task = Task::default();
        assert_eq!(task.result(), None);
        wait(&mut task, 3, |key| 2 * key);
        assert_eq!(task.result(), Some((&3, &6)));
        // The same key is not worked on again.
        task.want(&Context::default(), 3, || panic!("again"));
        assert!(!task.is_busy());
        wait(&mut task, 4, |key| 2 * key);
        assert_eq!(task.result(), Some((&4, &8)));
    }

    #[test]
    fn work_rests_unless_it_is_hurried() {
        let mut task = Task { rest: Some(Instant::now() + Duration::from_secs(3600)), ..Task::default() };
        task.want(&Context::default(), 1, || 1);
        assert!(!task.is_busy() && task.is_behind());
        task.hurry();
        wait(&mut task, 1, |key| key);
        assert!(!task.is_behind());
        assert_eq!((task.take(), task.take()), (Some(1), None));
        // A taken result still counts as done.
        task.want(&Context::default(), 1, || panic!("again"));
        assert!(!task.is_busy());
    }

    #[test]
    fn a_panic_ends_only_its_work() {
        let mut task = Task::default();
        wait(&mut task, 1, |_| panic!("deliberate"));
        assert_eq!(task.result(), None);
        wait(&mut task, 2, |key| key);
        assert_eq!(task.result(), Some((&2, &2)));
    }
}
