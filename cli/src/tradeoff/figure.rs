//! The columns of a trade-off: what is measured of each cell.

/// Declares an enum whose variants are named in experiment files, each with its column in the results and its unit.
macro_rules! columns {
    ($(#[$meta:meta])* $name:ident {
        $($(#[doc = $doc:literal])+ $variant:ident = $column:literal, $unit:literal;)*
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
        pub enum $name {
            $($(#[doc = $doc])+ $variant,)*
        }

        impl $name {
            /// All of them, in the order of the columns.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The column's name.
            pub fn column(self) -> &'static str {
                match self {
                    $(Self::$variant => $column,)*
                }
            }

            /// The unit in words; empty for plain numbers.
            pub fn unit(self) -> &'static str {
                match self {
                    $(Self::$variant => $unit,)*
                }
            }

            /// What it is, in a sentence.
            pub fn doc(self) -> &'static str {
                match self {
                    $(Self::$variant => concat!($($doc),+).trim_ascii(),)*
                }
            }
        }
    };
}

columns! {
    /// The errors of a picture against its reference. The same in every run. Means over the compared frames.
    Metric {
        /// Mean FLIP of the displayed pictures; 0: no difference.
        Flip = "flip", "";
        /// Root of the mean squared difference of linear light, of what is displayed: clamped to [0, 1].
        Rmse = "rmse", "";
        /// Mean of (a - r)^2 / (r^2 + 0.01) in linear light, without the 0.1% of the pixels with the largest errors.
        RelMse = "rel_mse", "";
        /// Peak signal-to-noise ratio of the displayed sRGB values; empty if the pictures are equal.
        Psnr = "psnr", "dB";
        /// Mean structural similarity of the displayed pictures; 1: no difference.
        Ssim = "ssim", "";
        /// FLIP within 2 pixels of the reference's edges; empty if there are no edges.
        EdgeFlip = "edge_flip", "";
        /// PSNR within 2 pixels of the reference's edges.
        EdgePsnr = "edge_psnr", "dB";
        /// Root mean square change of the displayed values (0 to 1) from the frame before, over the pixels whose
        /// reference changes by at most 1/255 in each channel; empty if there are no such pixels.
        Flicker = "flicker", "";
        /// Share of the pixels without a point; empty if the graph has no port with the points of pixels.
        Holes = "holes", "";
        /// Frames after the abrupt change until FLIP is at most 10% above its steady value; empty without a change.
        Latency = "latency", "frames";
    }
}

columns! {
    /// What a frame costs.
    Cost {
        /// Light paths per pixel and frame, as many as were asked for.
        PathsPerPixel = "paths_per_pixel", "paths per pixel and frame";
        /// Light paths per pixel and frame that were traced, mean over the compared frames. Fewer than were asked for if
        /// the graph asks for fewer samples than it may; empty if no node has a number of paths.
        PathsTraced = "paths_traced", "traced paths per pixel and frame";
        /// Samples per frame, as many as were asked for.
        Samples = "samples_per_frame", "samples per frame";
        /// Bytes that the graph's memory takes, on both sides.
        PeakBytes = "peak_bytes", "bytes";
        /// Bytes moved between CPU and GPU in a frame, median.
        BytesMoved = "bytes_moved", "bytes per frame";
        /// Samples that arrived in a frame, that is rays from the camera, mean over the compared frames.
        Rays = "rays", "rays per frame";
        /// Time of all nodes and transfers but for tracing, median over the frames.
        FrameMs = "frame_ms", "ms per frame without tracing";
        /// Time of tracing, median over the frames.
        TraceMs = "trace_ms", "ms per frame of tracing";
        /// Time of all nodes and transfers, median over the frames.
        TotalMs = "total_ms", "ms per frame";
    }
}

impl Metric {
    /// Whether larger figures are better.
    pub fn more_is_better(self) -> bool {
        matches!(self, Self::Psnr | Self::Ssim | Self::EdgePsnr)
    }

    /// Its name in print.
    pub fn name(self) -> &'static str {
        match self {
            Self::Flip => "FLIP",
            Self::Rmse => "RMSE",
            Self::RelMse => "relMSE",
            Self::Psnr => "PSNR",
            Self::Ssim => "SSIM",
            Self::EdgeFlip => "edge FLIP",
            Self::EdgePsnr => "edge PSNR",
            Self::Flicker => "flicker",
            Self::Holes => "holes",
            Self::Latency => "latency",
        }
    }

    /// Digits behind the point of its figures.
    pub fn digits(self) -> usize {
        if matches!(self, Self::Psnr | Self::EdgePsnr) { 2 } else { 4 }
    }

    /// A figure with its name and unit: `PSNR 31.20 dB`.
    pub fn written(self, value: f64) -> String {
        let (name, digits, unit) = (self.name(), self.digits(), self.unit());
        format!("{name} {value:.digits$} {unit}").trim_end().to_owned()
    }
}

impl Cost {
    /// Whether it is a time, which differs from run to run.
    pub fn is_time(self) -> bool {
        matches!(self, Self::FrameMs | Self::TraceMs | Self::TotalMs)
    }
}

/// relMSE x ms: a method is as good as another one if it has half the error in twice the time.
pub const INEFFICIENCY: (&str, &str) =
    ("inefficiency", "rel_mse x total_ms: the lower, the better the time is used.");

/// The FLIP between two halves of the reference.
pub const REFERENCE_FLIP: &str = "reference_flip";
/// The PSNR of the reference.
pub const REFERENCE_PSNR: &str = "reference_psnr";
/// The share of the pixels near edges of the reference.
pub const EDGE_SHARE: &str = "edge_share";
/// The share of the pixels over which flicker is measured.
pub const STATIC_SHARE: &str = "static_share";

/// What is known of the reference itself, with descriptions. The errors first.
pub const REFERENCE: [(&str, &str); 6] = [
    (REFERENCE_FLIP, "FLIP between two independent halves of the reference's samples."),
    ("reference_rmse", "RMSE of the reference: half of that between its halves."),
    ("reference_rel_mse", "Relative MSE of the reference: a quarter of that between its halves."),
    (REFERENCE_PSNR, "PSNR of the reference, dB: that between its halves and 6.02; empty if they are equal."),
    (EDGE_SHARE, "Share of the pixels within 2 pixels of the reference's edges."),
    (STATIC_SHARE, "Share of the pixels that flicker is measured over; empty where it is not."),
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn columns_have_names_and_sentences_of_their_own() {
        let metrics = Metric::ALL.iter().map(|metric| (metric.column(), metric.doc()));
        let costs = Cost::ALL.iter().map(|cost| (cost.column(), cost.doc()));
        let all: Vec<_> = metrics.chain(costs).chain([INEFFICIENCY]).chain(REFERENCE).collect();
        let (names, docs): (BTreeSet<_>, BTreeSet<_>) = all.iter().copied().unzip();
        assert_eq!((names.len(), docs.len()), (all.len(), all.len()));
        assert!(docs.iter().all(|doc| doc.ends_with('.')), "{docs:?}");
        assert!(
            Metric::Flicker.doc().contains("over the pixels whose reference"),
            "{}",
            Metric::Flicker.doc()
        );
    }
}
