//! The figures as tables and as JSON.

use serde_json::{Value, json};

use super::{Coded, Coverage, Figures, peer};
use crate::{bench::Skipped, table::Table};

/// The source of the paper's figures.
const SOURCE: &str = "Kim, Lee, Varshney: Vertex Transformation Streams, figures 10 to 14; Pentium 4 1.6 GHz, GeForce \
                      6800 Ultra";

const MIB: f64 = (1 << 20) as f64;

/// The paper's figures of a model with two pools.
struct Paper {
    name: &'static str,
    points: f64,
    covered: f64,
    /// MiB a frame, conventional and as streams.
    mib: [f64; 2],
    /// Frames a second, likewise.
    frames: [f64; 2],
    /// KB of pools.
    pools: f64,
}

const PAPERS: [Paper; 3] = [
    Paper {
        name: "Troll",
        points: 1.69e6,
        covered: 1.37e6,
        mib: [12.92, 3.45],
        frames: [20.3, 24.3],
        pools: 997.0,
    },
    Paper {
        name: "David",
        points: 1.17e6,
        covered: 878e3,
        mib: [8.90, 2.92],
        frames: [29.8, 35.0],
        pools: 712.0,
    },
    Paper {
        name: "Manuscript",
        points: 1.02e6,
        covered: 926e3,
        mib: [7.75, 1.25],
        frames: [32.9, 43.4],
        pools: 565.0,
    },
];

/// What was measured.
pub struct Report<'a> {
    pub models: &'a [Figures],
    pub skipped: &'a [Skipped],
    pub threads: usize,
}

impl Report<'_> {
    pub fn text(&self) -> String {
        let mut text = format!(
            "Streams as in the paper: 88 translations, 8 bytes a point conventionally, two pools; the last level, and the level\n\
             whose nodes have about as many points as the paper's. Frames a second of all points of the last level on the CPU, packed\n\
             and as streams.\n\n{}\n\
             Coverage and time by the number of pools, in the level like the paper's; seconds for all levels, on {} threads.\n\n{}\n\
             Codecs: bytes a point in the last level, seconds to encode all levels, million points a second that one core\n\
             decodes to cells, which is a copy for packed ones. {}.\n\n{}\n",
            self.paper(),
            self.threads,
            self.by_pools(),
            peer::note(),
            self.codecs()
        );
        for model in self.models {
            text += &format!("{}: {}\n", model.name, verdict(model));
        }
        text += "\nA flight through each model, encoded as small as it goes, with colours and normals if it has some:\n\n";
        for model in self.models {
            text += &format!("{}\n", model.flight.text());
        }
        text += &format!("\nThe paper's figures: {SOURCE}\n");
        for Skipped { what, why } in self.skipped {
            text += &format!("left out: {what}: {why}\n");
        }
        text
    }

    fn paper(&self) -> Table {
        let mut table = Table::new(&[
            "model",
            ">level",
            ">points",
            ">a node",
            ">covered",
            ">MiB",
            ">streams",
            ">ratio",
            ">pools KB",
            ">B/covered",
            ">frames/s",
        ]);
        for model in self.models {
            let two = model.pools.iter().find(|of| of[0].pools == 2);
            let levels = two.iter().flat_map(|of| of.iter().rev());
            let mut seen = None;
            for level in levels.filter(|level| seen.replace(level.level) != Some(level.level)) {
                table.row([
                    model.name.clone(),
                    level.level.to_string(),
                    level.points.to_string(),
                    (level.points / level.nodes).to_string(),
                    percent(level.covered, level.points),
                    format!("{:.2}", level.conventional as f64 / MIB),
                    format!("{:.2}", level.streams as f64 / MIB),
                    format!("{:.2}", level.ratio()),
                    format!("{:.0}", level.in_pools as f64 / 1000.0),
                    format!("{:.2}", level.in_pools as f64 / level.covered.max(1) as f64),
                    match level.level == two.map_or(0, |of| of[0].level) {
                        true => format!("{:.1} to {:.1}", model.frames[0], model.frames[1]),
                        false => "-".into(),
                    },
                ]);
            }
        }
        for paper in &PAPERS {
            table.row([
                format!("paper: {}", paper.name),
                "8".into(),
                format!("{:.0}", paper.points),
                format!("{:.0}", paper.points / 128.0),
                format!("{:.1}%", 100.0 * paper.covered / paper.points),
                format!("{:.2}", paper.mib[0]),
                format!("{:.2}", paper.mib[1]),
                format!("{:.2}", paper.mib[0] / paper.mib[1]),
                format!("{:.0}", paper.pools),
                format!("{:.2}", 1000.0 * paper.pools / paper.covered),
                format!("{} to {}", paper.frames[0], paper.frames[1]),
            ]);
        }
        table
    }

    fn by_pools(&self) -> Table {
        let mut table = Table::new(&["model", ">pools", ">covered", ">ratio", ">seconds"]);
        for model in self.models {
            for [_, level] in &model.pools {
                table.row([
                    model.name.clone(),
                    level.pools.to_string(),
                    percent(level.covered, level.points),
                    format!("{:.2}", level.ratio()),
                    format!("{:.1}", level.seconds),
                ]);
            }
        }
        table
    }

    fn codecs(&self) -> Table {
        let mut table =
            Table::new(&["model", "codec", ">points", ">bytes/point", ">encode s", ">decode M/s"]);
        for model in self.models {
            for coded in &model.codecs {
                table.row([
                    model.name.clone(),
                    coded.codec.clone(),
                    coded.points.to_string(),
                    format!("{:.3}", coded.per_point()),
                    format!("{:.1}", coded.encode),
                    format!("{:.0}", coded.decode / 1e6),
                ]);
            }
        }
        table
    }

    pub fn json(&self) -> Value {
        let level = |of: &Coverage| {
            json!({
                "pools": of.pools, "seconds": of.seconds, "level": of.level, "nodes": of.nodes, "points": of.points,
                "covered": of.covered, "conventional_bytes": of.conventional, "streams_bytes": of.streams,
                "pool_bytes": of.in_pools,
            })
        };
        let coded = |of: &Coded| {
            json!({
                "codec": of.codec, "points": of.points, "bytes": of.bytes, "encode_seconds": of.encode,
                "decode_points_per_second": of.decode,
            })
        };
        let models: Vec<Value> = self
            .models
            .iter()
            .map(|model| {
                json!({
                    "model": model.name, "points": model.points,
                    "last_level": model.pools.iter().map(|of| level(&of[0])).collect::<Vec<_>>(),
                    "level_like_the_papers": model.pools.iter().map(|of| level(&of[1])).collect::<Vec<_>>(),
                    "frames_per_second": { "packed": model.frames[0], "streams": model.frames[1] },
                    "codecs": model.codecs.iter().map(coded).collect::<Vec<_>>(),
                    "flight": model.flight.json(),
                })
            })
            .collect();
        let papers: Vec<Value> = PAPERS
            .iter()
            .map(|paper| {
                json!({
                    "model": paper.name, "points": paper.points, "covered": paper.covered,
                    "conventional_mib": paper.mib[0], "streams_mib": paper.mib[1], "pool_kb": paper.pools,
                    "frames_per_second": paper.frames,
                })
            })
            .collect();
        let skipped: Vec<Value> =
            self.skipped.iter().map(|skipped| json!({ "what": skipped.what, "why": skipped.why })).collect();
        json!({
            "threads": self.threads, "models": models, "papers": papers, "papers_source": SOURCE,
            "skipped": skipped,
        })
    }
}

impl Coverage {
    fn ratio(&self) -> f64 {
        self.conventional as f64 / self.streams as f64
    }
}

impl Coded {
    fn per_point(&self) -> f64 {
        self.bytes as f64 / self.points as f64
    }
}

/// How the streams compare with the other codecs, and the smallest with the peer.
fn verdict(model: &Figures) -> String {
    let pairs = [("streams", "packed"), ("streams", "brick"), ("streams", "meshopt"), ("best", "meshopt")];
    let of = |name: &str| model.codecs.iter().find(|coded| coded.codec == name);
    let words = pairs.into_iter().filter_map(|(one, other)| {
        let share = of(one)?.per_point() / of(other)?.per_point();
        let word = if share > 1.0 { "loses to" } else { "beats" };
        Some(format!("{one} {word} {other} ({share:.2} times its bytes)"))
    });
    words.collect::<Vec<_>>().join(", ")
}

fn percent(part: usize, of: usize) -> String {
    format!("{:.1}%", 100.0 * part as f64 / of as f64)
}
