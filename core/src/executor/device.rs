//! The GPU as the executor sees it: one device and queue, and the first asynchronous error.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use super::{RunError, programs::Programs};

/// Which adapters are acceptable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdapterChoice {
    /// A hardware GPU.
    Hardware,
    /// A hardware GPU if there is one, else software such as Mesa's lavapipe.
    Any,
}

/// An open device. Cheap to share behind an `Arc`.
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    failure: Arc<Mutex<Option<RunError>>>,
    pub(crate) programs: Programs,
}

impl Gpu {
    /// Every adapter of this machine.
    ///
    /// Mesa's driver looks for a Wayland display when adapters are listed, and its library prints an error if there is
    /// none. Frames need no display, so the error is misleading: stderr is suppressed meanwhile.
    pub fn adapters() -> Vec<wgpu::Adapter> {
        // One thread at a time, so that none prints while another ends the suppression.
        static LISTING: Mutex<()> = Mutex::new(());
        let _alone = LISTING.lock().unwrap_or_else(PoisonError::into_inner);
        let no_session = cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none();
        // Somebody else may hold stderr back already.
        let _quiet = no_session.then(gag::Gag::stderr).and_then(Result::ok);
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY))
    }

    /// Opens the best adapter.
    ///
    /// # Errors
    /// [`RunError::NoGpu`] if there is no adapter, [`RunError::Gpu`] if it cannot be opened.
    pub fn open(choice: AdapterChoice) -> Result<Self, RunError> {
        pollster::block_on(Self::open_best(Self::adapters(), choice))
    }

    async fn open_best(adapters: Vec<wgpu::Adapter>, choice: AdapterChoice) -> Result<Self, RunError> {
        let hardware_only = choice == AdapterChoice::Hardware;
        let adapter = adapters
            .into_iter()
            .filter(|adapter| !hardware_only || adapter.get_info().device_type != wgpu::DeviceType::Cpu)
            .min_by_key(|adapter| rank(adapter.get_info().device_type))
            .ok_or(RunError::NoGpu)?;
        let wanted = wgpu::Features::TIMESTAMP_QUERY
            | wgpu::Features::SHADER_INT64
            | wgpu::Features::SHADER_INT64_ATOMIC_MIN_MAX;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("epigraph"),
            required_features: adapter.features() & wanted,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (device, queue) =
            adapter.request_device(&descriptor).await.map_err(|error| RunError::Gpu(error.to_string()))?;
        let failure = Arc::new(Mutex::new(None));
        let first = failure.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            note(&first, RunError::Gpu(error.to_string()));
        }));
        let first = failure.clone();
        device.set_device_lost_callback(move |_, message| {
            let reason = if message.is_empty() { "its driver gives no reason".into() } else { message };
            note(&first, RunError::Lost(reason));
        });
        Ok(Self { device, queue, info: adapter.get_info(), failure, programs: Programs::default() })
    }

    /// The adapter's name and driver.
    pub fn name(&self) -> String {
        format!("{} ({})", self.info.name, self.info.backend)
    }

    /// Whether the adapter runs on the CPU: correct, but its times say nothing about a GPU.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Whether shaders may use 64-bit atomic minimum.
    pub fn has_atomic64(&self) -> bool {
        self.device.features().contains(wgpu::Features::SHADER_INT64_ATOMIC_MIN_MAX)
    }

    /// The largest storage buffer that a shader can bind, in bytes.
    pub fn most_bound(&self) -> u64 {
        self.device.limits().max_storage_buffer_binding_size
    }

    /// Whether the device can measure time itself. Timestamps of software adapters are not reliable.
    pub fn has_timestamps(&self) -> bool {
        !self.is_software() && self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }

    /// The first error since the last call of this function that no other call returned.
    pub(crate) fn check(&self) -> Result<(), RunError> {
        self.check_lost()?;
        self.failure().take().map_or(Ok(()), Err)
    }

    /// Whether the device is lost. A lost device does not come back: every later call fails.
    pub(crate) fn check_lost(&self) -> Result<(), RunError> {
        match &*self.failure() {
            Some(lost @ RunError::Lost(_)) => Err(lost.clone()),
            _ => Ok(()),
        }
    }

    fn failure(&self) -> MutexGuard<'_, Option<RunError>> {
        self.failure.lock().expect("no panic while noting a failure")
    }

    /// Waits until all submitted work is done.
    pub(crate) fn wait(&self) -> Result<(), RunError> {
        // A minute is far longer than any frame: the device hangs, and the user should know.
        let poll = wgpu::PollType::Wait { submission_index: None, timeout: Some(Duration::from_secs(60)) };
        let polled = self.device.poll(poll).map_err(|error| RunError::Gpu(error.to_string()));
        // The device's own message about a loss matters more than the failed wait.
        self.check().and(polled.map(|_| ()))
    }

    /// Destroys the device, as a driver update or a pulled cable would: every later call fails with
    /// [`RunError::Lost`].
    pub fn lose(&self) {
        self.device.destroy();
    }

    /// Runs `make` and returns validation and out-of-memory errors in it as an error.
    pub(crate) fn scoped<T>(&self, make: impl FnOnce() -> T) -> Result<T, RunError> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = make();
        let error = pollster::block_on(validation.pop());
        let error = pollster::block_on(memory.pop()).or(error);
        match error {
            Some(error) => Err(RunError::Gpu(error.to_string())),
            None => Ok(made),
        }
    }
}

/// The order in which adapters are chosen, the best first.
fn rank(device: wgpu::DeviceType) -> u32 {
    match device {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

fn note(first: &Mutex<Option<RunError>>, failure: RunError) {
    let mut first = first.lock().expect("no panic while noting a failure");
    // A loss explains all failures that were reported before it.
    if first.is_none() || matches!(failure, RunError::Lost(_)) {
        *first = Some(failure);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hardware_comes_first_and_software_last() {
        use wgpu::DeviceType::*;
        assert!([DiscreteGpu, IntegratedGpu, VirtualGpu, Other, Cpu].map(rank).is_sorted_by(|a, b| a < b));
        let has_hardware = Gpu::adapters().iter().any(|adapter| adapter.get_info().device_type != Cpu);
        match Gpu::open(AdapterChoice::Hardware) {
            Ok(gpu) => assert!(has_hardware && !gpu.is_software()),
            Err(error) => assert!(!has_hardware && error == RunError::NoGpu, "{error}"),
        }
        assert_eq!(Gpu::open(AdapterChoice::Any).unwrap().is_software(), !has_hardware);
    }

    #[test]
    fn a_loss_explains_what_failed_before_and_other_failures_are_told_once() {
        let gpu = Gpu::open(AdapterChoice::Any).unwrap();
        let failures = ["one", "other"].map(|text| RunError::Gpu(text.into()));
        assert_eq!(gpu.check(), Ok(()));
        failures.iter().for_each(|failure| note(&gpu.failure, failure.clone()));
        assert_eq!((gpu.check_lost(), gpu.check(), gpu.check()), (Ok(()), Err(failures[0].clone()), Ok(())));
        let lost = RunError::Lost("unplugged".into());
        for failure in [&failures[0], &lost, &failures[1]] {
            note(&gpu.failure, failure.clone());
        }
        for _ in 0..2 {
            assert_eq!((gpu.check_lost(), gpu.check()), (Err(lost.clone()), Err(lost.clone())));
        }
    }

    #[test]
    fn errors_in_a_scope_are_returned_and_others_are_noted() {
        let gpu = Gpu::open(AdapterChoice::Any).unwrap();
        let wrong = || {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("wrong"),
                size: 16,
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::STORAGE,
                mapped_at_creation: false,
            })
        };
        let text = gpu.scoped(wrong).unwrap_err().to_string();
        assert!(text.contains("wrong"), "{text}");
        assert_eq!((gpu.check(), gpu.scoped(|| 3)), (Ok(()), Ok(3)));
        wrong();
        assert!(matches!(gpu.check(), Err(RunError::Gpu(text)) if text.contains("wrong")));
        assert_eq!(gpu.wait(), Ok(()));
        gpu.lose();
        let lost = gpu.wait().unwrap_err();
        assert_eq!(lost.to_string(), "the GPU was lost: its driver gives no reason");
    }
}
