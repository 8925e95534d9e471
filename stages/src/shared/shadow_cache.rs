//! The shadow boundaries of a world, found on demand and cached: in the requesting frame, or on background threads.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use epigraph_scenes::{Scene, ShadowSearch, ShadowSegments, ShadowSettings, Tracer};

use super::source::Pace;

/// Maximum number of cached searches: a graph with two stages of different parameters, and some room to try others.
const KEPT_SEARCHES: usize = 4;

/// Shadow boundaries by search settings: the most recent searches, oldest first.
#[derive(Default)]
pub struct ShadowCache(Mutex<Vec<Arc<Search>>>);

/// A search through the poses of a scene.
pub struct Search {
    settings: ShadowSettings,
    how: How,
}

enum How {
    Exact(Box<Mutex<Exact>>),
    Async(Worker),
}

/// A search within the requesting frame.
struct Exact {
    search: ShadowSearch,
    /// The scene that was searched last, in its pose, and the result.
    last: Option<(Arc<Scene>, Arc<ShadowSegments>)>,
}

/// A search on a background thread; dropping it stops the search at the next opportunity.
struct Worker(Arc<Shared>);

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    /// Signalled when there is a pose to search, or the thread should end.
    changed: Condvar,
}

#[derive(Default)]
struct State {
    /// The last requested pose.
    asked: Option<Arc<Scene>>,
    /// Its tracer, until the thread takes it.
    waiting: Option<Arc<Tracer>>,
    found: Option<Arc<ShadowSegments>>,
    stop: bool,
}

impl ShadowCache {
    /// The shadow boundaries of the tracer's scene in its pose. With [`Pace::Async`] those found last, or none yet: if
    /// something has moved since, a new search runs in the background. The same value until the result changes.
    ///
    /// # Errors
    /// If the system cannot start a thread for the search.
    pub fn find(
        &self,
        tracer: &Arc<Tracer>,
        settings: ShadowSettings,
        pace: Pace,
    ) -> Result<Option<Arc<ShadowSegments>>, String> {
        let search = self.search(settings, pace)?;
        Ok(match &search.how {
            How::Exact(exact) => lock(exact).find(tracer),
            How::Async(worker) => worker.ask(tracer),
        })
    }

    /// The search with these settings, started if necessary.
    fn search(&self, settings: ShadowSettings, pace: Pace) -> Result<Arc<Search>, String> {
        let mut searches = lock(&self.0);
        if let Some(known) = searches.iter().find(|search| search.settings == settings) {
            return Ok(known.clone());
        }
        let how = match pace {
            Pace::Exact => {
                How::Exact(Box::new(Mutex::new(Exact { search: ShadowSearch::new(settings), last: None })))
            }
            Pace::Async => How::Async(Worker::start(settings)?),
        };
        let search = Arc::new(Search { settings, how });
        if searches.len() == KEPT_SEARCHES {
            searches.remove(0);
        }
        searches.push(search.clone());
        Ok(search)
    }

    /// The greatest such number among those of the cached results.
    pub fn most(&self, number: fn(&ShadowSegments) -> usize) -> usize {
        let of_search = |search: &Arc<Search>| match &search.how {
            How::Exact(exact) => lock(exact).last.as_ref().map_or(0, |(_, found)| number(found)),
            How::Async(worker) => lock(&worker.0.state).found.as_ref().map_or(0, |found| number(found)),
        };
        lock(&self.0).iter().map(of_search).max().unwrap_or(0)
    }

    /// The settings of the cached searches.
    #[cfg(test)]
    pub fn kept(&self) -> Vec<ShadowSettings> {
        lock(&self.0).iter().map(|search| search.settings).collect()
    }
}

impl Exact {
    fn find(&mut self, tracer: &Tracer) -> Option<Arc<ShadowSegments>> {
        let scene = tracer.scene();
        let before = self.last.take();
        let found = match before {
            Some((of, found)) if Arc::ptr_eq(&of, scene) => found,
            before => {
                let found = self.search.find(tracer, &|_| true)?;
                same_or(before.map(|(_, found)| found), found)
            }
        };
        self.last = Some((scene.clone(), found.clone()));
        Some(found)
    }
}

/// The previous result if the new one is equal, so that its users need not read it again.
fn same_or(before: Option<Arc<ShadowSegments>>, found: ShadowSegments) -> Arc<ShadowSegments> {
    before.filter(|before| **before == found).unwrap_or_else(|| Arc::new(found))
}

impl Worker {
    /// Starts the thread, which uses half of the machine's threads: the others are left for the frames.
    fn start(settings: ShadowSettings) -> Result<Self, String> {
        let fail = |error: &dyn std::fmt::Display| format!("no thread for the search for shadows: {error}");
        let threads = std::thread::available_parallelism().map_or(1, |all| all.get().div_ceil(2));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|error| fail(&error))?;
        let worker = Self(Arc::default());
        let shared = worker.0.clone();
        let thread = std::thread::Builder::new().name("shadow edges".into());
        thread.spawn(move || pool.install(|| shared.work(settings))).map_err(|error| fail(&error))?;
        Ok(worker)
    }

    /// The last result; a newly requested pose replaces one that is still waiting.
    fn ask(&self, tracer: &Arc<Tracer>) -> Option<Arc<ShadowSegments>> {
        let mut state = lock(&self.0.state);
        if !state.asked.as_ref().is_some_and(|asked| Arc::ptr_eq(asked, tracer.scene())) {
            state.asked = Some(tracer.scene().clone());
            state.waiting = Some(tracer.clone());
            self.0.changed.notify_one();
        }
        state.found.clone()
    }
}

impl Shared {
    /// The thread's main loop: searches the newest pose, again and again, and skips poses that came meanwhile. It does
    /// not abort a search for a newer pose, though: while things move, one would come in every frame, and no search
    /// would finish.
    fn work(&self, settings: ShadowSettings) {
        let mut search = ShadowSearch::new(settings);
        while let Some(tracer) = self.next() {
            let wanted = |_: f32| !lock(&self.state).stop;
            let Some(found) = search.find(&tracer, &wanted) else { return };
            let mut state = lock(&self.state);
            let before = state.found.take();
            state.found = Some(same_or(before, found));
            if tracer.scene().bodies.is_empty() {
                // It has one pose.
                return;
            }
        }
    }

    /// Waits for a pose; `None` if the thread should end.
    fn next(&self) -> Option<Arc<Tracer>> {
        let idle = |state: &mut State| !state.stop && state.waiting.is_none();
        let state = self.changed.wait_while(lock(&self.state), idle);
        let mut state = state.unwrap_or_else(PoisonError::into_inner);
        if state.stop { None } else { state.waiting.take() }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        lock(&self.0.state).stop = true;
        self.0.changed.notify_one();
    }
}

/// Locks even after a panic elsewhere: no critical section here leaves half a change behind.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use epigraph_scenes::{Pose, shadow_segments};

    use super::*;

    fn moving() -> Arc<Tracer> {
        Arc::new(Tracer::new(Arc::new(Scene::load("cornell-moving").unwrap())))
    }

    fn expected(tracer: &Tracer) -> ShadowSegments {
        shadow_segments(tracer, &ShadowSettings::default(), &|_| true).unwrap()
    }

    /// Requests a pose until `counts` accepts the result, for at most ten seconds.
    fn ask_until(
        cache: &ShadowCache,
        tracer: &Arc<Tracer>,
        counts: impl Fn(&ShadowSegments) -> bool,
    ) -> Arc<ShadowSegments> {
        let pace = Pace::Async;
        for _ in 0..1000 {
            let found = cache.find(tracer, ShadowSettings::default(), pace).unwrap();
            if let Some(found) = found.filter(|found| counts(found)) {
                return found;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("not found in ten seconds")
    }

    #[test]
    fn with_exact_pace_each_pose_has_its_own_boundaries() {
        let (cache, tracer) = (ShadowCache::default(), moving());
        let find = |tracer: &Arc<Tracer>| {
            cache.find(tracer, ShadowSettings::default(), Pace::Exact).unwrap().unwrap()
        };
        for frame in [0, 1, 2, 40, 7] {
            let posed = tracer.at(frame);
            let found = find(&posed);
            assert_eq!(*found, expected(&posed), "frame {frame}");
            assert!(found.segments.len() > 20);
            assert!(Arc::ptr_eq(&found, &find(&posed)), "the same pose is searched again");
        }
    }

    #[test]
    fn equal_results_are_the_same_value() {
        let (cache, tracer) = (ShadowCache::default(), moving());
        let rest = tracer.scene().poses.clone();
        // The light and its mount do not move. A box moves far away, and then farther.
        let away = |x: f32| {
            let mut poses = rest.clone();
            poses[0] = Pose { translation: glam::Vec3::new(x, 0.0, 0.0), ..Pose::REST };
            Arc::new(tracer.posed(&poses))
        };
        let find = |tracer: &Arc<Tracer>| {
            cache.find(tracer, ShadowSettings::default(), Pace::Exact).unwrap().unwrap()
        };
        let [here, far, farther] = [find(&away(0.0)), find(&away(40.0)), find(&away(41.0))];
        assert!(!Arc::ptr_eq(&here, &far) && Arc::ptr_eq(&far, &farther));
    }

    #[test]
    fn with_asynchronous_pace_a_pose_gets_the_last_boundaries_until_its_own_are_found() {
        let (cache, tracer) = (ShadowCache::default(), moving());
        let first = tracer.at(0);
        let found = ask_until(&cache, &first, |_| true);
        assert_eq!(*found, expected(&first));
        // One pose per frame: the first answers are those of an older pose, and in the end the newest pose gets its
        // own.
        let pace = Pace::Async;
        for frame in 1..30 {
            let now = cache.find(&tracer.at(frame), ShadowSettings::default(), pace).unwrap().unwrap();
            assert!(frame > 1 || Arc::ptr_eq(&now, &found));
        }
        let last = tracer.at(30);
        let expected = expected(&last);
        ask_until(&cache, &last, |found| *found == expected);
    }

    #[test]
    fn a_dropped_search_ends() {
        let worker = Worker::start(ShadowSettings::default()).unwrap();
        let shared = worker.0.clone();
        worker.ask(&moving());
        drop(worker);
        for _ in 0..1000 {
            // The thread holds the other reference.
            if Arc::strong_count(&shared) == 1 {
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("the search has not ended");
    }
}
