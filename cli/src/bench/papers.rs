//! The papers' own figures, shown beside ours.

use super::times::Times;

/// The source of the figures. The GPU rows also appear in table 4 of the technical report of 2005, on which this paper
/// is based.
pub const SOURCE: &str = "Velázquez-Armendáriz, Lee, Bala, Walter: Implementing the Render Cache and the \
                          Edge-and-Point Image on Graphics Hardware, Graphics Interface 2006, tables 1 and 2";

/// The papers' machine.
pub const MACHINE: &str = "Pentium 4 3.2 GHz dual core, GeForce 7800 GTX, 512x512";

/// The papers' image size in pixels.
pub const SIZE: [u32; 2] = [512, 512];

/// The approximate number of points in their cloud at 512x512.
pub const POINTS: u64 = 300_000;

/// The papers' figures for one scene.
pub struct Paper {
    /// Our scene that matches theirs best.
    pub scene: &'static str,
    /// The papers' name of their scene, and how it differs from ours.
    pub theirs: &'static str,
    /// Edges of their mesh.
    pub edges: u32,
    /// Their hybrid of CPU and GPU.
    pub gpu: Times,
    /// The original on the CPU, which reports no separate time for I1.
    pub cpu: Times,
}

/// The papers' figures for one of our scenes.
pub fn of(scene: &str) -> Option<&'static Paper> {
    PAPERS.iter().find(|paper| paper.scene == scene)
}

/// Every scene of the papers.
pub const PAPERS: &[Paper] = &[
    Paper {
        scene: "cornell",
        theirs: "Cornell box",
        edges: 75,
        gpu: gpu([5.14, 12.31, 1.34, 1.08, 0.34, 0.43, 1.09, 7.29], 32.32, 42.82),
        cpu: cpu([6.68, 13.87, 4.73, 2.01, 0.08, 5.63, 28.70], 69.14),
    },
    Paper {
        scene: "chains",
        theirs: "Chains",
        edges: 110_592,
        gpu: gpu([4.02, 10.77, 1.30, 1.07, 1.54, 0.99, 1.44, 7.17], 31.81, 41.32),
        cpu: cpu([5.22, 13.17, 4.75, 2.11, 3.91, 12.36, 28.09], 72.93),
    },
    Paper {
        scene: "room",
        theirs: "Mack room (ours is another room)",
        edges: 153_526,
        gpu: gpu([3.71, 9.48, 1.20, 1.06, 1.86, 1.93, 1.38, 7.06], 31.17, 45.73),
        cpu: cpu([4.73, 13.27, 4.59, 1.97, 2.17, 14.77, 27.97], 76.43),
    },
    Paper {
        scene: "bust",
        theirs: "David head (ours is another head)",
        edges: 374_635,
        gpu: gpu([4.37, 11.92, 1.18, 1.05, 4.92, 5.87, 1.15, 7.11], 40.78, 53.73),
        cpu: cpu([6.35, 13.54, 4.52, 1.95, 8.43, 40.11, 27.85], 108.08),
    },
    Paper {
        scene: "dragon",
        theirs: "Dragon",
        edges: 1_305_164,
        gpu: gpu([4.15, 12.79, 1.18, 1.06, 13.81, 7.88, 1.25, 7.11], 52.22, 64.16),
        cpu: cpu([6.30, 14.18, 4.83, 2.10, 22.29, 45.41, 33.91], 134.73),
    },
];

/// A row from the times P1 to I2, the GPU total and the frame time.
const fn gpu(ms: [f64; 8], gpu: f64, frame: f64) -> Times {
    let [p1, p2, p3, p4, e1, e2, i1, i2] = ms;
    let columns = [Some(p1), Some(p2), Some(p3), Some(p4), Some(e1), Some(e2), Some(i1), Some(i2)];
    let rest = frame - (p1 + p2 + p3 + p4 + e1 + e2 + i1 + i2);
    Times { columns, rest, gpu: Some(gpu), frame }
}

/// A row from the times P1 to E2, I2 (which includes I1) and the frame time.
const fn cpu(ms: [f64; 7], frame: f64) -> Times {
    let [p1, p2, p3, p4, e1, e2, i2] = ms;
    let columns = [Some(p1), Some(p2), Some(p3), Some(p4), Some(e1), Some(e2), None, Some(i2)];
    let rest = frame - (p1 + p2 + p3 + p4 + e1 + e2 + i2);
    Times { columns, rest, gpu: None, frame }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_rates_match_the_printed_ones() {
        let printed = [
            ("cornell", 23.35, 14.46),
            ("chains", 24.20, 13.71),
            ("room", 21.87, 13.08),
            ("bust", 18.61, 9.25),
            ("dragon", 15.59, 7.42),
        ];
        assert_eq!(printed.len(), PAPERS.len());
        for (scene, gpu, cpu) in printed {
            let paper = of(scene).unwrap();
            assert!((paper.gpu.fps() - gpu).abs() < 0.01, "{scene}: {}", paper.gpu.fps());
            assert!((paper.cpu.fps() - cpu).abs() < 0.01, "{scene}: {}", paper.cpu.fps());
        }
    }

    #[test]
    fn the_columns_sum_to_less_than_the_frame() {
        for paper in PAPERS {
            for times in [&paper.gpu, &paper.cpu] {
                let sum: f64 = times.columns.iter().flatten().sum();
                // A mistyped digit or a missing column would break these bounds.
                assert!(sum < times.frame && sum > 0.6 * times.frame, "{}: {sum}", paper.scene);
                assert!((sum + times.rest - times.frame).abs() < 1e-9);
                assert!(times.gpu.is_none_or(|gpu| gpu < times.frame));
            }
            // P1 runs on the CPU; all other columns are part of the GPU total.
            let on_gpu: f64 = paper.gpu.columns[1..].iter().flatten().sum();
            assert!(paper.gpu.gpu.unwrap() > on_gpu, "{}", paper.scene);
        }
    }

    #[test]
    fn scenes_are_sorted_by_edges_and_so_is_the_time_of_e1() {
        for pair in PAPERS.windows(2) {
            assert!(pair[0].edges < pair[1].edges);
            assert!(pair[0].gpu.columns[4] < pair[1].gpu.columns[4]);
        }
    }
}
