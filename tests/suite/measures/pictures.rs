//! What people look at: ports as pictures, words, tables and files, and the metrics of pictures.

use std::{fs, sync::Arc};

use epigraph::Place;
use epigraph_core::{Dims, Element, Format, PortElement, Settings, Snapshot, testing::Random};
use epigraph_pictures::{
    Curve, Difference, Histogram, Kind, Look, Mode, Paint, Picture, PortFile, Ramp, Scale, Table, ages,
    apart, describe, edges, flip, frames_ago, grouped, in_pixel, lanes, metrics, readable, show,
    svg::{Anchor, Font, Svg},
    tone,
};
use epigraph_stages::registry;
use epigraph_tests::{Run, graph, sampled};

use super::{Figure, Figures, assert_same};

/// Looks that differ in every setting.
fn looks() -> Vec<Look> {
    let plain = Look::default();
    let mut looks = vec![
        plain,
        Look { log: true, ..plain },
        Look { lane: 1, exposure: 1.5, channels: [2, 0, 0], ..plain },
        Look { range: Some([0.5, 3.0]), far: 2.5, ..plain },
        Look { range: Some([3.0, 1.0]), lane: 2, ..plain },
    ];
    for (mode, _) in Mode::ALL {
        looks.push(Look { mode: Some(mode), ..plain });
        looks.push(Look {
            mode: Some(mode),
            log: true,
            lane: 1,
            far: 3.0,
            ramp: Ramp::ALL[looks.len() % Ramp::ALL.len()].0,
            ..plain
        });
    }
    looks
}

/// All that can be shown of a port.
fn add(figure: &mut Figure, snapshot: &Snapshot) {
    let [width, height] = [snapshot.dims.width, snapshot.dims.height].map(|side| side as usize);
    for look in looks() {
        let shown = show(snapshot, &look);
        figure.debug(&(look, shown.size, shown.mode, shown.scale, shown.odd));
        figure.exact(shown.colors.as_flattened());
        figure.debug(&Histogram::new(snapshot, &look));
        figure.debug(&Picture::of_port(snapshot, &shown));
        if let Some(scale) = shown.scale {
            figure.debug(&[0.0, 0.2, 0.5, 1.0].map(|share| (scale.value(share), scale.color_at(share))));
            figure.debug(&[0, 1, 3, 8].map(|most| scale.ticks(most)));
        }
        for at in
            [[0, 0], [width / 2, height / 2], [width.saturating_sub(1), height.saturating_sub(1)], [width, 0]]
        {
            figure.text(&format!("{:?}", in_pixel(snapshot, &look, at)));
            figure.text(&format!("{:?}", describe(snapshot, at)));
        }
    }
    figure.text(&String::from_utf8_lossy(&Kind::Csv.encode(&[snapshot], &Look::default()).expect("a table")));
    let table = Table::new(vec![Arc::new(snapshot.clone())]);
    for (column, heading) in table.columns.iter().enumerate() {
        figure.text(&heading.name);
        (0..table.rows + 1)
            .step_by(1 + table.rows / 30)
            .for_each(|row| figure.text(&table.text(row, column)));
        figure.debug(&[true, false].map(|descending| table.order(column, descending)));
    }
}

#[test]
fn ports_as_pictures_and_words_are_as_before() {
    let mut figures = Figures::new();
    let place = Place::load("cornell", "orbit").expect("a scene and a camera path");
    let settings = Settings { poison: true, ..sampled([23, 17], 0.1) };
    let mut run = Run::with_all_ports(&graph("epi.ron"), &place, &settings);
    run.frames(6);
    let snapshots: Vec<Snapshot> =
        run.executor.snapshots().expect("on the CPU").into_iter().cloned().collect();
    for snapshot in &snapshots {
        add(figures.entry(format!("{} {}", snapshot.name, snapshot.field)).or_default(), snapshot);
    }
    let of = |name: &str, field: &str| {
        let found = snapshots.iter().find(|snapshot| snapshot.name == name && snapshot.field == field);
        found.unwrap_or_else(|| panic!("no {name} {field}"))
    };
    let (id, meta) = (of("edges/reach_cull.id", ""), of("cloud/age.cloud", "meta"));
    for snapshot in [ages(id, meta), frames_ago(id, meta, meta, 9)].into_iter().flatten() {
        add(figures.entry("ages".into()).or_default(), &snapshot);
    }
    // Values that are none, in all kinds of elements, with all meanings.
    let formats = Format::ALL.map(Element::Texel);
    let items =
        [i32::element(), u32::element(), f32::element(), <[f32; 2]>::element(), <[u32; 4]>::element()];
    let mut random = Random(4);
    for element in formats.into_iter().chain(items) {
        let dims = Dims { width: 7, height: 5 };
        let odd = [
            u32::MAX,
            0xDEAD_BEEF,
            0,
            1,
            255,
            256,
            0x7F80_0000,
            0x7FC0_0000,
            0xBF80_0000,
            0x3F80_0000,
            0x80,
            0xFFFF_FF00,
        ];
        let meanings = registry().meanings().into_iter().map(Some).chain([None]);
        for meaning in meanings {
            let word = |random: &mut Random| match random.below(3) {
                0 => odd[random.below(odd.len() as u32) as usize],
                1 => random.between(-2.0, 9.0).to_bits(),
                _ => random.bits() >> random.below(32),
            };
            let words = dims.count() * element.bytes() as usize / 4;
            let bytes = (0..words).flat_map(|_| word(&mut random).to_le_bytes()).collect();
            let (name, field, element) = ("made up".to_owned(), String::new(), element.clone());
            let figure = figures.entry(format!("{element} as {meaning:?}")).or_default();
            figure.debug(&lanes(&element));
            figure.debug(&Mode::of_port(meaning, &element));
            add(figure, &Snapshot { name, field, meaning, element, dims, frame: 3, bytes });
        }
    }
    assert_same("looks", &figures);
}

#[test]
fn metrics_and_files_of_pictures_are_as_before() {
    let mut figures = Figures::new();
    let mut random = Random(8);
    let folder = std::env::temp_dir().join(format!("epigraph-pictures-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a temporary folder");
    for size in [[1, 1], [1, 9], [13, 2], [31, 23], [65, 34], [300, 3]] {
        let figure = figures.entry(format!("{}x{}", size[0], size[1])).or_default();
        let pixels = size[0] * size[1];
        for amount in [0.0, 0.02, 1.0] {
            let a: Vec<[f32; 3]> = (0..pixels).map(|_| [0; 3].map(|_| random.between(0.0, 1.2))).collect();
            let b: Vec<[f32; 3]> = a
                .iter()
                .map(|color| color.map(|value| (value + random.between(-amount, amount)).max(0.0)))
                .collect();
            let mask: Vec<bool> = (0..pixels).map(|_| random.below(3) > 0).collect();
            figure.debug(&(metrics::rmse(&a, &b), metrics::psnr(&a, &b), metrics::ssim(&a, &b, size)));
            let plane = flip::flip(&a, &b, size);
            figure.debug(&plane);
            for linear in [false, true] {
                let [a, b] = [&a, &b].map(|colors| Picture { size, colors: colors.clone(), linear });
                let mut steps = Vec::new();
                let difference = Difference::watched(&a, &b, &mut |step| steps.push(step));
                figure.debug(&(difference.psnr(), difference.psnr_within(&mask), difference.ssim()));
                figure.debug(&(difference.flip(), difference.flip_within(&mask)));
                difference.ssim_watched(&mut |step| steps.push(step));
                figure.debug(&steps);
                figure.debug(&a.srgb());
                let port = a.to_port("a");
                add(figure, &port);
                for ending in ["png", "exr"] {
                    let path = folder.join(format!("a.{ending}"));
                    PortFile::picture(&path)
                        .and_then(|file| file.write(&[&port], &Look::default()))
                        .unwrap_or_else(|error| panic!("{error}"));
                    figure.debug(&Picture::read(&path).unwrap_or_else(|error| panic!("{error}")));
                }
            }
            let [a, b] =
                [&a, &b].map(|colors| colors.iter().map(|color| tone::to_srgb8(*color)).collect::<Vec<_>>());
            for gain in [1.0, 3.5] {
                figure.debug(&apart(&a, &b, gain));
            }
        }
    }
    fs::remove_dir_all(&folder).expect("a temporary folder");
    let figure = figures.entry("numbers".into()).or_default();
    for range in [[0.0, 1.0], [1.0, 0.0], [2.0, 2.0], [-3.0, 50.0], [0.01, 1e4], [5.0, 0.1], [f32::NAN, 1.0]]
    {
        for curve in [Curve::Linear, Curve::Log, Curve::Reciprocal] {
            for paint in
                [Paint::Grey, Paint::Depth].into_iter().chain(Ramp::ALL.map(|(ramp, _)| Paint::Ramp(ramp)))
            {
                let scale = Scale { range, curve, paint };
                figure.debug(
                    &[-1.0, 0.0, 0.3, 1.0, 7.0, 1e6, f32::INFINITY]
                        .map(|value| (scale.share(value), scale.color(value))),
                );
                figure.debug(&[0.0, 0.1, 0.9, 1.0].map(|share| (scale.value(share), scale.color_at(share))));
                figure.debug(&[0, 1, 2, 5, 20].map(|most| scale.ticks(most)));
            }
        }
    }
    for word in (0..400).map(|_| random.bits() >> random.below(32)).chain([0, u32::MAX]) {
        figure.debug(&(
            edges::strokes(word),
            edges::class(word),
            edges::class_color(word),
            edges::chord(word),
        ));
        figure.debug(&edges::reach_glyph(word));
        figure.text(&format!("{} {}", readable(u64::from(word) * 37), grouped(u64::from(word))));
    }
    for step in 0..=100 {
        let share = step as f32 / 80.0 - 0.1;
        figure.debug(&(tone::encode(share), tone::decode(share), tone::to_byte(share)));
        figure.debug(&Ramp::ALL.map(|(ramp, _)| (ramp.label(), ramp.color(share))));
    }
    let mut svg = Svg::default();
    svg.rect([1.0, 2.25], [3.0, 4.5], "red");
    svg.line([0.0, 0.0], [5.125, 6.0], "blue", 1.5);
    svg.polyline(&[[0.0, 1.0], [2.0, 3.0], [4.0, 4.5]], "green", 2.0);
    svg.dashed(&[[0.0, 1.0], [2.0, 3.0]], "green", 2.0);
    svg.polygon(&[[0.0, 1.0], [2.0, 3.0], [4.0, 4.5]], "black");
    svg.dot([3.0, 3.0], 1.25, "white");
    for anchor in [Anchor::Start, Anchor::Middle, Anchor::End] {
        svg.text([1.0, 9.0], "a < b & \"c\"", anchor, Font { size: 12.0, color: "black", bold: true });
    }
    figure.text(&svg.finish([20.0, 30.0]));
    assert_same("pictures", &figures);
}
