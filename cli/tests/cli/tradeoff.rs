//! `epigraph tradeoff`: experiments, what they keep, and how they are spread over processes.

use std::{collections::BTreeMap, fs, path::Path, thread, time::Instant};

use serde_json::Value;

use crate::support::Place;

/// An experiment of four cells of the Cornell box, with further fields.
fn experiment(more: &str) -> String {
    format!(
        "Tradeoff(
            version: 1,
            doc: \"What do edges bring?\",
            graphs: [\"render-cache\", \"epi\"],
            scenes: [\"cornell\"],
            sizes: [\"32x32\"],
            budgets: [Samples(\"5%\"), PathsPerPixel(0.8)],
            reference: (spp: 8),
            backend: \"cpu\",
            quick: (frames: 2, compare: [1]),
            {more}
        )"
    )
}

/// The lines of the results, as fields by column, without those of times.
fn errors(place: &Place, folder: &str) -> Vec<Vec<(String, String)>> {
    let text = fs::read_to_string(place.path(&format!("{folder}/results.csv"))).expect("written");
    let mut lines = text.lines().map(|line| line.split(',').map(String::from).collect::<Vec<_>>());
    let head = lines.next().expect("a heading");
    let is_time = |name: &str| name.ends_with("_ms") || name == "inefficiency";
    let of = |line: Vec<String>| {
        assert_eq!(line.len(), head.len(), "{text}");
        head.iter().cloned().zip(line).filter(|(name, _)| !is_time(name)).collect()
    };
    lines.map(of).collect()
}

fn figures(place: &Place, folder: &str) -> Value {
    let text = fs::read(place.path(&format!("{folder}/results.json"))).expect("written");
    serde_json::from_slice(&text).expect("JSON")
}

fn cells(place: &Place, folder: &str) -> usize {
    fs::read_dir(place.path(&format!("{folder}/cells"))).expect("there").count()
}

#[test]
fn cells_are_measured_kept_and_the_same_in_every_run() {
    let place = Place::new();
    place.write("t.ron", experiment("frames: 8, compare: [4, 7], seeds: [1, 2]"));
    let text = place.succeeds("tradeoff t.ron --out a");
    // A line for each pair of seeds.
    assert_eq!(text.lines().filter(|line| line.contains("  cornell  orbit   32x32  ")).count(), 4, "{text}");
    let value = figures(&place, "a");
    let all = value["cells"].as_array().expect("a list");
    assert_eq!((all.len(), &value["missing"]), (8, &0.into()));
    for cell in all {
        let measured = &cell["result"]["measured"];
        for (column, low, high) in [
            ("flip", 0.01, 0.5),
            ("rmse", 0.001, 0.5),
            ("rel_mse", 1e-4, 5.0),
            ("psnr", 10.0, 50.0),
            ("ssim", 0.2, 1.0),
            ("edge_flip", 0.01, 0.6),
            ("edge_psnr", 8.0, 50.0),
            ("flicker", 0.001, 0.5),
            ("holes", 0.05, 0.99),
            ("reference_flip", 0.001, 0.2),
        ] {
            let figure =
                measured["errors"][column].as_f64().unwrap_or_else(|| panic!("{column}: {measured}"));
            assert!((low..high).contains(&figure), "{column} is {figure}");
        }
        // 5% of 32 x 32, or 0.8 x 1024 / 4.
        let samples = if cell["cell"]["budget"] == "5%" { 51 } else { 205 };
        assert_eq!(cell["cell"]["samples"], samples);
        // A dither asks for at most as many.
        let rays = measured["costs"]["rays"].as_f64().expect("a number");
        assert!((0.9 * f64::from(samples)..=f64::from(samples)).contains(&rays), "{rays} of {samples}");
        assert_eq!(measured["frames"].as_array().map(Vec::len), Some(2));
        let nodes = measured["nodes"].as_array().expect("a list");
        assert!(nodes.iter().any(|node| node["kind"] == "trace" && node["backend"] == "cpu"), "{measured}");
    }
    for name in ["flip-over-paths_per_pixel.svg", "flip-over-total_ms.svg", "flip-over-frames.svg"] {
        assert!(fs::read_to_string(place.path(&format!("a/{name}"))).expect("written").ends_with("</svg>\n"));
    }
    let nodes = fs::read_to_string(place.path("a/ms-by-node.svg")).expect("written");
    assert!(nodes.contains(">epi, 0.8 paths/pixel<") && nodes.ends_with("</svg>\n"), "{nodes}");
    // The reference, and the cells of the first seed with their error maps.
    let page = fs::read_to_string(place.path("a/page.html")).expect("written");
    assert_eq!(page.matches("data:image/png;base64,iVBORw0KGgo").count(), 1 + 2 * 4);
    assert!(page.contains("<h1>What do edges bring?</h1>") && page.matches("<svg").count() == 4);
    place.succeeds("tradeoff t.ron --out b --threads 1");
    assert_eq!(errors(&place, "a"), errors(&place, "b"));

    // What is gone is measured again, and nothing else.
    let before = place.contents();
    let gone = all[3]["cell"]["key"].as_str().expect("a name").to_owned();
    place.remove(&format!("a/cells/{gone}.json"));
    let run = place.run("tradeoff t.ron --out a");
    assert!(run.stderr.contains("7 of 8 cells are done already"), "{}", run.stderr);
    assert_eq!(errors(&place, "a"), errors(&place, "b"));
    let changed = |path: &str| before[&place.path(path)] != fs::read(place.path(path)).expect("there");
    let others =
        all.iter().map(|cell| cell["cell"]["key"].as_str().expect("a name")).filter(|key| *key != gone);
    assert!(
        changed(&format!("a/cells/{gone}.json"))
            && !others.into_iter().any(|key| changed(&format!("a/cells/{key}.json")))
    );
}

#[test]
fn the_figures_are_those_of_render_and_compare() {
    let place = Place::new();
    place.write(
        "t.ron",
        experiment("frames: 6").replace("[\"render-cache\", \"epi\"]", "[\"epi+sigma=0.5\"]"),
    );
    place.succeeds("tradeoff t.ron --out a");
    let value = figures(&place, "a");
    let cell = &value["cells"][0];
    let variant = cell["cell"]["variant"].as_str().expect("a name");
    place.succeeds(&format!(
        "render {variant} --size 32x32 --frames 6 --samples 51 --backend cpu --out p.png"
    ));
    // Of a moving camera, the frame before is traced for flicker as well.
    let last =
        fs::read_dir(place.path("a/references")).expect("there").map(|entry| entry.expect("there").path());
    let is_last = |path: &std::path::PathBuf| {
        path.extension().is_some_and(|ending| ending == "json")
            && serde_json::from_slice::<Value>(&fs::read(path).expect("there")).expect("JSON")["frame"] == 5
    };
    let picture = last.into_iter().find(is_last).expect("frame 5 is compared").with_extension("exr");
    let by_hand = place.succeeds(&format!("compare {} p.png --json -", picture.display()));
    let by_hand: Value = serde_json::from_str(&by_hand).expect("JSON");
    for column in ["flip", "psnr", "ssim"] {
        let ours = cell["result"]["measured"]["errors"][column].as_f64().expect("a number");
        assert!(
            (ours - by_hand[column].as_f64().expect("a number")).abs() < 1e-6,
            "{column}: {ours}, {by_hand}"
        );
    }
}

#[test]
fn a_cell_that_fails_is_reported_and_the_rest_goes_on() {
    let place = Place::new();
    let text = experiment("frames: 2").replace("\"render-cache\", \"epi\"", "\"hybrid\", \"render-cache\"");
    place.write("t.ron", text);
    // The hybrid needs a GPU, which only its run finds missing.
    let run = place.run_without_gpu("tradeoff t.ron --out a");
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    assert!(run.stderr.contains("failed: hybrid, cornell, orbit, 32x32, 5%, seed 1: "), "{}", run.stderr);
    assert!(run.stderr.contains("error: 2 of 4 cells failed"), "{}", run.stderr);
    let lines =
        run.stdout.lines().filter(|line| line.contains("failed: ") && line.contains("but none was found"));
    assert_eq!(lines.count(), 2, "{}", run.stdout);
    let value = figures(&place, "a");
    let failed =
        value["cells"].as_array().expect("a list").iter().filter(|cell| cell["result"]["failed"].is_string());
    assert_eq!(failed.count(), 2);
    // It is tried again.
    let run = place.run("tradeoff t.ron --out a");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stderr.contains("2 of 4 cells are done already"), "{}", run.stderr);
}

#[cfg(unix)]
#[test]
fn processes_share_the_cells_and_one_that_is_killed_is_made_up_for() {
    let place = Place::new();
    place.write("t.ron", experiment("frames: 300"));
    // The first process of xargs is killed while it works.
    place.write(
        "job.sh",
        "if mkdir first 2> /dev/null; then timeout -s KILL 0.15 \"$EPIGRAPH\" tradeoff t.ron --out a --run \"$1\"\n\
         else \"$EPIGRAPH\" tradeoff t.ron --out a --run \"$1\"; fi",
    );
    let run = place.shell(
        "\"$EPIGRAPH\" tradeoff t.ron --jobs > jobs && xargs -d '\\n' -n 1 -P 2 bash job.sh < jobs > /dev/null",
    );
    assert_ne!(run.code, Some(0), "no process was killed");
    let jobs = fs::read_to_string(place.path("jobs")).expect("written");
    assert_eq!(jobs.lines().filter(|line| serde_json::from_str::<Value>(line).is_ok()).count(), 4, "{jobs}");
    let done = cells(&place, "a");
    assert!((1..4).contains(&done), "{done} of 4 cells are done");

    let collected = place.run("tradeoff t.ron --out a --collect");
    assert_eq!(collected.code, Some(1));
    let missing =
        format!("{} of 4 cells are missing; epigraph tradeoff t.ron --out a measures them", 4 - done);
    assert!(collected.stderr.contains(&missing), "{}", collected.stderr);
    assert_eq!(errors(&place, "a").len(), done);
    let listed = place.succeeds("tradeoff t.ron --out a --list");
    assert_eq!(listed.lines().filter(|line| line.ends_with("done")).count(), done, "{listed}");
    assert_eq!(place.succeeds("tradeoff t.ron --out a --jobs").lines().count(), 4 - done);

    let run = place.run("tradeoff t.ron --out a");
    assert!(run.stderr.contains(&format!("{done} of 4 cells are done already")), "{}", run.stderr);
    place.succeeds("tradeoff t.ron --out b");
    assert_eq!(errors(&place, "a"), errors(&place, "b"));
    // What is done already is not done again.
    let job = place.shell("\"$EPIGRAPH\" tradeoff t.ron --out a --run \"$(head -n 1 jobs)\"");
    assert!(
        job.code == Some(0) && job.stdout.ends_with(", seed 1: done\n"),
        "{}\n{}",
        job.stdout,
        job.stderr
    );
}

/// The pictures that an SVG holds, in its order.
fn pictures(svg: &str) -> Vec<image::RgbImage> {
    use base64::{Engine, engine::general_purpose::STANDARD};
    let urls = svg.split("href=\"data:image/png;base64,").skip(1);
    let decode = |text: &str| {
        let bytes = STANDARD.decode(text.split_once('"').expect("a quote").0).expect("base64");
        image::load_from_memory(&bytes).expect("a picture").into_rgb8()
    };
    urls.map(decode).collect()
}

#[test]
fn a_figure_has_crops_errors_and_whole_pictures() {
    let place = Place::new();
    place.write("t.ron", experiment("frames: 4, seeds: [1, 2], metrics: [Flip, Psnr]"));
    place.succeeds("tradeoff t.ron --out a");
    let before = place.contents();
    // Two graphs at the first budget and the reference, with two crops each, two error maps, the whole picture, the
    // colours' scale.
    let text = place.succeeds("tradeoff t.ron --out a --collect --figure f.svg");
    assert!(text.ends_with("figure   f.svg\n"), "{text}");
    let svg = fs::read_to_string(place.path("f.svg")).expect("written");
    assert_eq!(pictures(&svg).len(), 3 * 2 + 2 + 1 + 1);
    assert!(svg.starts_with("<svg ") && svg.contains(" width=\"504.57pt\""), "178 mm are 504.57 points");
    let value = figures(&place, "a");
    let means = |graph: &str, metric: &str| {
        let of = |cell: &&Value| cell["cell"]["graph"] == graph && cell["cell"]["budget"] == "5%";
        let cells: Vec<&Value> = value["cells"].as_array().expect("a list").iter().filter(of).collect();
        assert_eq!(cells.len(), 2);
        let figure = |cell: &&Value| cell["result"]["measured"]["errors"][metric].as_f64().expect("a number");
        cells.iter().map(figure).sum::<f64>() / 2.0
    };
    for graph in ["render-cache", "epi"] {
        for text in [
            format!(">FLIP {:.4}<", means(graph, "flip")),
            format!(">PSNR {:.2} dB<", means(graph, "psnr")),
            format!(" font-weight=\"600\">{graph}<"),
        ] {
            assert!(svg.contains(&text), "{text} is not in the figure");
        }
    }
    assert!(svg.contains(">5% samples<") && svg.contains(">8 samples/pixel<"));
    // The better one is bold: they are far apart.
    let best =
        format!(" font-weight=\"600\">FLIP {:.4}<", means("epi", "flip").min(means("render-cache", "flip")));
    assert_eq!(svg.matches(" font-weight=\"600\">FLIP").count(), 1);
    assert!(svg.contains(&best));
    // Nothing is measured again.
    let after = place.contents();
    let is_kept = |path: &Path| {
        ["cells", "pictures", "references"].iter().any(|name| path.starts_with(place.path("a").join(name)))
    };
    assert!(before.iter().filter(|(path, _)| is_kept(path)).all(|(path, bytes)| after[path] == *bytes));

    // Given crops, in one column at another budget: pixels of the kept picture, as squares.
    place.succeeds("tradeoff t.ron --out a --collect --figure g.svg --crop 3,4,8x6 --show epi --width 85");
    let svg = fs::read_to_string(place.path("g.svg")).expect("written");
    let found = pictures(&svg);
    assert_eq!(found.len(), 2 + 1 + 1 + 1);
    let key = value["cells"].as_array().expect("a list").iter().find(|cell| {
        cell["cell"]["graph"] == "epi" && cell["cell"]["budget"] == "5%" && cell["cell"]["seed"] == 1
    });
    let key = key.expect("it is there")["cell"]["key"].as_str().expect("a name");
    let kept = image::open(place.path(&format!("a/pictures/{key}.png"))).expect("a picture").into_rgb8();
    let crop = &found[1];
    assert_eq!(crop.dimensions(), (304, 228));
    assert!(crop.enumerate_pixels().all(|(x, y, pixel)| pixel == kept.get_pixel(3 + x / 38, 4 + y / 38)));
    // Two budgets of one graph.
    let shown = place.shell(
        "\"$EPIGRAPH\" tradeoff t.ron --out a --collect --figure h.svg --show 'epi, 5%' --show 'epi, 0.8 paths/pixel'",
    );
    assert_eq!(shown.code, Some(0), "{}", shown.stderr);
    let svg = fs::read_to_string(place.path("h.svg")).expect("written");
    assert!(svg.contains(">5% samples<") && svg.contains(">0.8 paths/pixel<"));

    fs::hard_link(place.path("t.ron"), place.path("linked.svg")).expect("links are possible");
    for (words, part) in [
        ("--figure f.png", "the figure is written as SVG; name it FILE.svg"),
        ("--figure t.svg --crop 30,0,8x8", "--crop 30,0,8x8 does not lie in a picture of 32x32 pixels"),
        ("--figure t.svg --crop 8x8", "such as 120,80,48x32"),
        ("--figure t.svg --show epy", "--show epy: the experiment has `render-cache, 5%`, "),
        ("--figure t.svg --width 20", "60..=500"),
        ("--crop 1,1,8x8", "--figure <FILE.svg>"),
        ("--list --figure t.svg", "cannot be used with"),
        ("--figure none/f.svg", "there is no folder"),
        ("--figure a/searches.svg", "--out and --figure both write a/searches.svg"),
        ("--figure linked.svg", "t.ron, which the command reads; name another file"),
    ] {
        let message = place.fails(&format!("tradeoff t.ron --out a {words}"));
        assert!(message.contains(part), "`{part}` is not in:\n{message}");
    }
    let message = place.fails("tradeoff t.ron --quick --out a --collect --figure t.svg");
    assert!(message.contains("nothing that it shows is measured"), "{message}");
}

#[cfg(target_os = "linux")]
#[test]
fn runs_that_are_killed_are_made_up_for() {
    let kills = std::env::var("EPIGRAPH_KILLS").map_or(24, |text| text.parse().expect("a number of kills"));
    let place = Place::new();
    place.write(
        "t.ron",
        experiment("frames: 6, seeds: [1, 2, 3], search: [Search(metric: Flip, target: 0.24)]"),
    );
    let start = Instant::now();
    place.succeeds("tradeoff t.ron --out b --figure b.svg");
    let took = start.elapsed();
    let paths = |folder: &str| -> BTreeMap<String, Vec<u8>> {
        let root = place.path(folder);
        let name = |path: &Path| path.strip_prefix(&root).ok().map(|path| path.display().to_string());
        place.contents().into_iter().filter_map(|(path, bytes)| Some((name(&path)?, bytes))).collect()
    };
    // What is measured, but for times.
    let errors_of = |bytes: &[u8]| {
        let value: Value = serde_json::from_slice(bytes).expect("whole");
        let measured = &value["result"]["measured"];
        (measured["errors"].clone(), measured["frames"].clone())
    };
    let whole = paths("b");
    let mut random = epigraph_core::testing::Random(11);
    let (mut kept, mut ended) = (0, 0);
    for _ in 0..kills {
        let mut running = place.start("tradeoff t.ron --out a --figure a.svg");
        thread::sleep(took.mul_f64(f64::from(random.below(1000)) / 1000.0));
        running.kill();
        let found = paths("a");
        for (name, bytes) in found.iter().filter(|(name, _)| !name.contains(".epigraph-")) {
            let of = &whole[name];
            match name.split_once('/') {
                Some(("cells", _)) => assert_eq!(errors_of(bytes), errors_of(of), "{name}"),
                Some(("pictures" | "references", _)) => assert!(bytes == of, "{name} is torn"),
                Some(("searches", _)) => assert_eq!(
                    serde_json::from_slice::<Value>(bytes).expect("whole")["result"]["within"]["interval"],
                    serde_json::from_slice::<Value>(of).expect("whole")["result"]["within"]["interval"]
                ),
                _ => assert!(bytes.ends_with(b"\n"), "{name} is torn"),
            }
        }
        kept += found.keys().filter(|name| name.starts_with("cells/")).count();
        if found.contains_key("results.csv") {
            // It was not killed before its end: from the beginning again.
            ended += 1;
            fs::remove_dir_all(place.path("a")).expect("it is there");
        }
    }
    assert!(kept > 0 && ended < kills, "{kills} kills, {kept} cells were there, {ended} runs had ended");
    place.succeeds("tradeoff t.ron --out a --figure a.svg");
    assert_eq!(errors(&place, "a"), errors(&place, "b"));
    assert!(paths("a").keys().eq(whole.keys()), "something was left behind");
    assert_eq!(
        fs::read(place.path("a.svg")).expect("written"),
        fs::read(place.path("b.svg")).expect("written")
    );
    println!("{kills} kills within {took:.2?}: {ended} runs had ended");
}

#[test]
fn wrong_experiments_are_reported_with_their_places() {
    let place = Place::new();
    let fails = |text: &str, words: &str, parts: &[&str]| {
        place.write("t.ron", text);
        let message = place.fails(words);
        for part in parts {
            assert!(message.contains(part), "`{part}` is not in:\n{message}");
        }
    };
    let with = |more: &str| experiment(&format!("frames: 2,\n{more}"));
    let all = "tradeoff t.ron --out a";
    for (from, to, parts) in [
        ("\"epi\"", "\"epy\"", ["t.ron:4:38: ", "unknown graph, file or command `epy`, did you mean `epi`?"]),
        ("\"epi\"", "\"epi+sigm=1\"", ["t.ron:4:38: ", "did you mean `sigma`?"]),
        ("\"epi\"", "\"render-cache+age.evict=false\"", ["", ""]),
        ("cornell", "cornel", ["t.ron:5:22: ", "did you mean `cornell`?"]),
        (
            "0.8",
            "8",
            ["t.ron:7:38: 8 paths/pixel is 2048 samples of 4 paths", "an image of 32x32 has 1024 pixels"],
        ),
    ] {
        if !parts[0].is_empty() {
            fails(&with("").replacen(from, to, 1), all, &parts);
        }
    }
    for (more, parts) in [
        ("cameras: [\"orbti\"]", ["t.ron:12:11: ", "did you mean `orbit`?"]),
        (
            "vary: Grid({ \"trace.spp\": [4, 9999] })",
            ["t.ron:12:31: ", "parameter `spp` is 9999, outside 1 to 4096"],
        ),
        (
            "vary: Grid({ \"trace.sp\": [4] })",
            ["t.ron:12:27: ", "unknown parameter `sp`, did you mean `spp`?"],
        ),
        ("vary: Grid({ \"interpolate.sigma\": [0.5] })", ["t.ron:12:36: ", "unknown node `interpolate`"]),
        (
            "vary: Grid({ \"tonemap.exposure\": [Auto] })",
            ["t.ron:12:35: tonemap: its exposure is Auto", "0 EV"],
        ),
        ("metrics: [Fli]", ["t.ron:12:11: unknown name `Fli`, did you mean `Flip`?", "metrics: [Fli]"]),
        ("sead: 3", ["t.ron:12:1: unknown field `sead`, did you mean `seeds`?", ""]),
    ] {
        fails(&with(more), all, &parts);
    }
    fails("Tradeoff(version: 1", all, &["t.ron:1:20: ", "is still open here"]);
    place.write("t.ron", with(""));
    for (words, part) in [
        ("tradeoff t.ron", "--out <DIR>"),
        ("tradeoff none.ron --out a", "cannot read none.ron"),
        ("tradeoff t.ron --out t.ron", "it is a file; name a folder"),
        ("tradeoff t.ron --out a --run x", "expected a line of --jobs"),
        ("tradeoff t.ron --out a --run {\"cell\":\"x\"}", "the experiment has no cell x"),
        ("tradeoff t.ron --out a --list --jobs", "cannot be used with"),
    ] {
        let message = place.fails(words);
        assert!(message.contains(part), "`{part}` is not in:\n{message}");
    }
    place.succeeds("tradeoff t.ron --quick --list");
    // Results do not replace an experiment.
    place.succeeds("tradeoff t.ron --quick --out a");
    place.write("a/results.json", with(""));
    let message = place.fails("tradeoff a/results.json --quick --out a");
    assert!(message.contains("results.json would replace"), "{message}");
}

#[cfg(unix)]
#[test]
fn shipped_experiments_are_valid_and_their_quick_forms_run() {
    let place = Place::new();
    // They name graphs from the repository's root.
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    let files = fs::read_dir(format!("{root}/graphs/tradeoffs"))
        .expect("there")
        .map(|entry| entry.expect("there").path());
    let files: Vec<_> = files.filter(|path| path.extension().is_some_and(|ending| ending == "ron")).collect();
    assert!(!files.is_empty());
    // They share references.
    let out = place.path("out");
    for file in files {
        for options in ["--list".to_owned(), format!("--quick --out {}", out.display())] {
            let line = format!("cd {root} && \"$EPIGRAPH\" tradeoff {} {options}", file.display());
            let run = place.shell(&line);
            assert_eq!(run.code, Some(0), "{line}\n{}\n{}", run.stdout, run.stderr);
        }
        let value = figures(&place, "out");
        let [cells, searches] =
            ["cells", "searches"].map(|list| value[list].as_array().expect("a list").len());
        assert!(cells + searches > 1, "{}: nothing to compare", file.display());
    }
}

#[test]
fn searches_find_equal_errors_and_go_on_where_they_were() {
    let place = Place::new();
    let text = experiment("frames: 6, search: [Search(metric: Flip, target: 0.24)], seeds: [1, 2, 3],")
        .replace("budgets: [Samples(\"5%\"), PathsPerPixel(0.8)],", "");
    place.write("t.ron", &text);
    let listed = place.succeeds("tradeoff t.ron --list");
    assert!(
        listed.contains("search for flip 0.24 of epi, cornell, orbit, 32x32, from 1 to 1024 samples"),
        "{listed}"
    );
    assert!(listed.contains("2 searches, 0 cells, "), "{listed}");
    let job = place.succeeds("tradeoff t.ron --jobs").lines().last().expect("a search").to_owned();
    place.write("job", &job);
    let run = place.shell("\"$EPIGRAPH\" tradeoff t.ron --out a --run \"$(cat job)\"");
    assert!(
        run.code == Some(0) && run.stdout.contains("search for flip 0.24 of epi: done"),
        "{}",
        run.stderr
    );
    let collected = place.run("tradeoff t.ron --out a --collect");
    assert!(collected.stderr.contains("1 of 2 cells and searches are missing"), "{}", collected.stderr);
    place.succeeds("tradeoff t.ron --out a");
    let value = figures(&place, "a");
    let searches = value["searches"].as_array().expect("a list");
    let found = |graph: &str| {
        let search = searches.iter().find(|search| search["cell"]["graph"] == graph).expect("there");
        let within = &search["result"]["within"];
        let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{search}"));
        let [low, high] = [0, 1].map(|end| number(&within["interval"][end]));
        let samples = number(&within["value"]);
        assert!(low <= samples && samples <= high && high <= 1024.0, "{search}");
        // Few frames of a small image are noisy.
        assert!((number(&within["figures"]["flip"]) / 0.24 - 1.0).abs() < 0.3, "{search}");
        samples
    };
    let text = fs::read_to_string(place.path("a/searches.csv")).expect("written");
    let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let of = |name: &str| lines[0].iter().position(|known| *known == name).expect("a column");
    assert_eq!(lines.len(), 3, "{text}");
    let within = &searches[1]["result"]["within"];
    assert_eq!(lines[2][of("graph")], "epi");
    for (name, value) in
        [("value", &within["value"]), ("low", &within["interval"][0]), ("psnr", &within["figures"]["psnr"])]
    {
        let found: f64 = lines[2][of(name)].parse().expect("a number");
        assert_eq!(Some(found), value.as_f64(), "{name}");
    }
    let page = fs::read_to_string(place.path("a/page.html")).expect("written");
    assert!(page.contains("<h2>Searches</h2>") && page.contains("<td>flip 0.24 over samples</td>"));
    assert!(place.path("a/searches.svg").exists());
    // Exact edges save samples.
    assert!(found("epi") < found("render-cache"), "{value}");
    assert!(!place.path("a/flip-over-total_ms.svg").exists(), "there are no cells to plot");
    let before = place.contents();
    place.succeeds("tradeoff t.ron --out a");
    let same = |(path, bytes): (&std::path::PathBuf, &Vec<u8>)| {
        path.ends_with("results.json") || place.contents().get(path) == Some(bytes)
    };
    assert!(before.iter().all(same), "something was measured again");
}

#[test]
fn searches_find_the_value_of_a_parameter() {
    let place = Place::new();
    // Pictures that are too bright differ more; more light paths a sample cost more time.
    let searches = "search: [
            Search(metric: Flip, target: 0.4, over: Param(\"tonemap.exposure\"), from: 0, to: 4),
            Search(metric: Psnr, target: 12, over: Param(\"exposure\"), from: 0.5, to: 4, budget: Samples(50)),
            Search(cost: TraceMs, target: 1e9, over: Param(\"trace.spp\"), from: 1, to: 4),
        ],";
    let text = experiment(&format!("frames: 6, seeds: [1, 2, 3], {searches}"))
        .replace("budgets: [Samples(\"5%\"), PathsPerPixel(0.8)],", "")
        .replace("\"render-cache\", ", "");
    place.write("t.ron", &text);
    let listed = place.succeeds("tradeoff t.ron --list");
    let first =
        "search for flip 0.4 over tonemap.exposure at 5% of epi, cornell, orbit, 32x32, from 0 to 4\n";
    assert!(listed.contains(first) && listed.contains(" over exposure at 50 of epi"), "{listed}");
    let table = place.succeeds("tradeoff t.ron --out a");
    assert!(table.contains("not reached") && table.contains("> 4"), "{table}");
    let value = figures(&place, "a");
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("no number: {value}"));
    for (search, column, target, width) in
        [(&value["searches"][0], "flip", 0.4, 0.6), (&value["searches"][1], "psnr", 12.0, 0.8)]
    {
        let within = &search["result"]["within"];
        let [low, high] = [0, 1].map(|end| number(&within["interval"][end]));
        assert!((low..=high).contains(&number(&within["value"])) && high - low < width, "{search}");
        assert!((number(&within["figures"][column]) / target - 1.0).abs() < 0.05, "{search}");
    }
    assert_eq!(value["searches"][2]["result"]["above"], 4.0);
    // The values that were tried are cells of their own; those of whole numbers are written as such.
    let tried = |param: &str| {
        let files =
            fs::read_dir(place.path("a/cells")).expect("there").map(|file| file.expect("there").path());
        let cells =
            files.map(|path| serde_json::from_slice::<Value>(&fs::read(path).expect("there")).expect("JSON"));
        let of = |cell: Value| cell["cell"]["params"][0].as_array().cloned();
        let values = cells.filter_map(of).filter(|set| set[0] == param).map(|set| set[1].clone());
        values.collect::<Vec<Value>>()
    };
    assert!(tried("trace.spp").iter().all(|value| value == "1" || value == "4"), "{:?}", tried("trace.spp"));
    assert!(tried("tonemap.exposure").len() > 12);

    for (from, to, part) in [
        ("\"exposure\"", "\"exposur\"", "t.ron:13:13: +exposur=0.5: "),
        ("from: 1, to: 4", "from: 0, to: 4", "parameter `spp` is 0, outside 1 to 4096"),
        ("Samples(50)", "Samples(5000)", "5000 is 5000 samples of 4 paths, more than one"),
    ] {
        place.write("t.ron", text.replacen(from, to, 1));
        let message = place.fails("tradeoff t.ron --list");
        assert!(message.contains(part), "`{part}` is not in:\n{message}");
    }
}

#[test]
fn the_latency_of_a_cut_is_measured() {
    let place = Place::new();
    let eye = "eye: (0.278, 0.273, -0.8), target: (0.278, 0.273, 0)";
    let keys = [
        (0.0, eye),
        (0.3, eye),
        (0.333_333, eye),
        (0.366_66, "eye: (0.4, 0.4, -0.4), target: (0.2, 0.1, 0.3)"),
    ];
    let keys: Vec<String> = keys.iter().map(|(time, view)| format!("(time: {time}, {view})")).collect();
    place.write("cut.ron", format!("(keys: [{}])", keys.join(", ")));
    let text = experiment("cameras: [\"fly:cut.ron\"], frames: 41, change: 11")
        .replace("PathsPerPixel(0.8)", "Samples(\"20%\")")
        .replace("quick: (frames: 2, compare: [1]),", "");
    place.write("t.ron", text);
    place.succeeds("tradeoff t.ron --out a");
    let value = figures(&place, "a");
    let latency = |graph: &str, budget: &str| {
        let cells = value["cells"].as_array().expect("a list");
        let is = |cell: &&Value| cell["cell"]["graph"] == graph && cell["cell"]["budget"] == budget;
        let measured = &cells.iter().find(is).expect("there")["result"]["measured"];
        let frames = measured["frames"].as_array().expect("a list");
        assert_eq!((frames.len(), &frames[0]["frame"]), (30, &11.into()));
        measured["errors"]["latency"].as_f64().expect("a number")
    };
    for graph in ["render-cache", "epi"] {
        let [few, many] = ["5%", "20%"].map(|budget| latency(graph, budget));
        // The view is new: no sample of it is there in the frame of the cut.
        assert!(1.0 <= many && many < few && few < 29.0, "{graph}: {few} frames at 5%, {many} at 20%");
    }
    // The view is still before and after the cut, and of each only one picture is traced.
    assert_eq!(fs::read_dir(place.path("a/references")).expect("there").count(), 2 * 2);
}
