//! The machine on which times were measured.

use std::path::Path;

use epigraph_core::Gpu;
use serde_json::{Value, json};

/// The facts about a machine that the figures depend on.
pub struct Machine {
    cpu: String,
    threads: usize,
    adapter: Option<String>,
    /// True if the adapter computes on the CPU, so that its times say nothing about a GPU.
    pub software: bool,
}

impl Machine {
    /// This machine, with `threads` threads and the adapter in use.
    pub fn new(threads: usize, gpu: Option<&Gpu>) -> Self {
        Self {
            cpu: processor(),
            threads,
            adapter: gpu.map(Gpu::name),
            software: gpu.is_some_and(Gpu::is_software),
        }
    }

    /// One line of text.
    pub fn text(&self) -> String {
        let adapter = match &self.adapter {
            Some(name) if self.software => format!("{name}, a software GPU"),
            Some(name) => name.clone(),
            None => "no GPU in use".into(),
        };
        format!("{}, {} threads; {adapter}", self.cpu, self.threads)
    }

    /// The same facts as JSON.
    pub fn json(&self) -> Value {
        json!({
            "cpu": self.cpu,
            "threads": self.threads,
            "adapter": self.adapter,
            "software_adapter": self.adapter.as_ref().map(|_| self.software),
            "os": std::env::consts::OS,
            "version": env!("CARGO_PKG_VERSION"),
        })
    }
}

/// The processor's model if Linux reports one, else its architecture.
fn processor() -> String {
    let text = epigraph_files::text(Path::new("/proc/cpuinfo")).unwrap_or_default();
    model(&text).unwrap_or(std::env::consts::ARCH).to_owned()
}

/// The first model name in the text of `/proc/cpuinfo`.
fn model(cpuinfo: &str) -> Option<&str> {
    let line = cpuinfo.lines().find_map(|line| line.strip_prefix("model name"))?;
    line.trim_start().strip_prefix(':').map(str::trim).filter(|name| !name.is_empty())
}

#[cfg(test)]
mod tests {
    use super::model;

    #[test]
    fn the_model_is_read_from_cpuinfo() {
        let text = "processor\t: 0\nmodel\t\t: 7\nmodel name\t: Some CPU @ 2 GHz\nmodel name\t: Other\n";
        assert_eq!(model(text), Some("Some CPU @ 2 GHz"));
        assert_eq!(model("CPU implementer\t: 0x41\n"), None);
        assert_eq!(model("model name\t:\n"), None);
    }
}
