//! The page of `epigraph tradeoff` in a browser: every control changes what is shown, in the way that it says.

use std::fs;

use image::RgbImage;
use serde_json::Value;

use crate::{browser::Browser, support::Place};

/// The page of an experiment with two views and a search, and the pictures that it holds, by view and label.
fn page() -> (Place, Vec<Value>) {
    let place = Place::new();
    place.write(
        "t.ron",
        "Tradeoff(
            version: 1,
            doc: \"Does it show?\",
            graphs: [\"render-cache\", \"epi\"],
            scenes: [\"cornell\"],
            sizes: [\"40x32\", \"24x32\"],
            frames: 4,
            compare: [2, 3],
            budgets: [Samples(\"5%\"), Samples(\"20%\")],
            search: [Search(metric: Flip, target: 0.3)],
            seeds: [1, 2, 3],
            metrics: [Flip, Psnr],
            reference: (spp: 8),
            backend: \"cpu\",
        )",
    );
    place.succeeds("tradeoff t.ron --out a");
    let text = fs::read_to_string(place.path("a/page.html")).expect("written");
    let (_, data) = text.split_once("<script type=\"application/json\" id=\"data\">").expect("the pictures");
    let (data, _) = data.split_once("</script>").expect("their end");
    let pictures = serde_json::from_str(data).expect("JSON");
    (place, pictures)
}

/// A picture that the page holds, enlarged as it shows it.
fn enlarged(pictures: &[Value], [view, label]: [&str; 2], which: &str, zoom: u32) -> RgbImage {
    use base64::{Engine, engine::general_purpose::STANDARD};
    let is = |picture: &&Value| picture["view"] == view && picture["label"] == label;
    let url = pictures.iter().find(is).expect("it is there")[which].as_str().expect("a picture");
    let bytes = STANDARD.decode(url.strip_prefix("data:image/png;base64,").expect("PNG")).expect("base64");
    let small = image::load_from_memory(&bytes).expect("a picture").into_rgb8();
    RgbImage::from_fn(small.width() * zoom, small.height() * zoom, |x, y| {
        *small.get_pixel(x / zoom, y / zoom)
    })
}

/// The largest difference of a channel, over the pixels from column `from` to column `to`.
fn apart(a: &RgbImage, b: &RgbImage, [from, to]: [u32; 2]) -> u8 {
    assert_eq!(a.dimensions(), b.dimensions());
    let pixels = a.enumerate_pixels().filter(|(x, ..)| (from..to).contains(x));
    pixels
        .flat_map(|(x, y, a)| (0..3).map(move |lane| a[lane].abs_diff(b.get_pixel(x, y)[lane])))
        .max()
        .unwrap_or(0)
}

/// Rounding of a channel, once for each layer.
const ROUNDING: u8 = 2;

const WIDE: &str = "cornell, orbit, 40x32";
const LABELS: [&str; 2] = ["reference", "epi, 5%"];

#[test]
fn pictures_are_wiped_flipped_and_compared() {
    let (place, pictures) = page();
    let mut browser = Browser::open(&place.path("a/page.html"), [1280, 900]);
    let zoom = 4;
    let [a, b] = LABELS.map(|label| enlarged(&pictures, [WIDE, label], "src", zoom));
    let width = a.width();
    let nth = |label: &str| {
        let is = |picture: &Value| picture["view"] == WIDE && picture["label"] == label;
        pictures.iter().position(is).expect("it is there").to_string()
    };
    for (side, label) in ["left", "right"].into_iter().zip(LABELS) {
        browser.choose(side, &nth(label));
    }
    assert_eq!(browser.eval("document.getElementById('zoom').value"), zoom.to_string());
    let stage = |browser: &mut Browser| {
        // Without its frame of one pixel.
        let shot = browser.picture("#stage");
        image::imageops::crop_imm(&shot, 1, 1, shot.width() - 2, shot.height() - 2).to_image()
    };
    let point = |browser: &mut Browser, share: f64| {
        let [left, top, width, height] = browser.place("#stage");
        [left + 1.0 + share * (width - 2.0), top + height / 2.0]
    };

    // Wiped: the left one up to the mouse, then the right one.
    let at = point(&mut browser, 0.3);
    browser.mouse("mouseMoved", at);
    let (shot, bar) = (stage(&mut browser), (0.3 * f64::from(width)) as u32);
    assert!(apart(&shot, &a, [0, bar - 3]) <= ROUNDING, "left of the bar is another picture");
    assert!(apart(&shot, &b, [bar + 3, width]) <= ROUNDING, "right of the bar is another picture");
    assert!(
        apart(&shot, &b, [0, bar - 3]) > 20 && apart(&shot, &a, [bar + 3, width]) > 20,
        "this test sees nothing"
    );

    // Flipped, by the mouse and by the space bar.
    browser.choose("mode", "flip");
    assert!(apart(&stage(&mut browser), &a, [0, width]) <= ROUNDING);
    browser.mouse("mousePressed", at);
    assert!(apart(&stage(&mut browser), &b, [0, width]) <= ROUNDING, "a held button does not flip");
    browser.mouse("mouseReleased", at);
    assert!(apart(&stage(&mut browser), &a, [0, width]) <= ROUNDING);
    browser.eval("document.activeElement.blur()");
    browser.space("keyDown");
    assert!(apart(&stage(&mut browser), &b, [0, width]) <= ROUNDING, "the space bar does not flip");
    browser.space("keyUp");
    assert!(apart(&stage(&mut browser), &a, [0, width]) <= ROUNDING);

    // Brighter: twice for each step.
    browser.choose("light", "1");
    let brighter = RgbImage::from_fn(width, a.height(), |x, y| {
        image::Rgb(a.get_pixel(x, y).0.map(|v| v.saturating_mul(2)))
    });
    assert!(
        apart(&stage(&mut browser), &brighter, [0, width]) <= 2 * ROUNDING,
        "brightness is no factor of two"
    );
    browser.choose("light", "0");

    // The difference, four times as bright.
    browser.choose("mode", "difference");
    let difference = RgbImage::from_fn(width, a.height(), |x, y| {
        let (a, b) = (a.get_pixel(x, y), b.get_pixel(x, y));
        image::Rgb(std::array::from_fn(|lane| a[lane].abs_diff(b[lane]).saturating_mul(4)))
    });
    assert!(apart(&stage(&mut browser), &difference, [0, width]) <= 4 * ROUNDING);
    let figures = browser.eval("document.getElementById('figures').textContent");
    let figures = figures.as_str().expect("a text");
    assert!(figures.contains("reference: 8 samples per pixel; epi, 5%: flip 0."), "{figures}");

    // Error maps; the reference has none.
    browser.choose("mode", "flip");
    browser.choose("what", "map");
    let nothing = RgbImage::new(width, a.height());
    assert!(apart(&stage(&mut browser), &nothing, [0, width]) <= ROUNDING, "the reference has an error map");
    browser.mouse("mousePressed", at);
    let map = enlarged(&pictures, [WIDE, LABELS[1]], "map", zoom);
    assert!(
        apart(&stage(&mut browser), &map, [0, width]) <= ROUNDING && apart(&map, &nothing, [0, width]) > 50
    );
    browser.mouse("mouseReleased", at);
    browser.choose("what", "src");

    // Larger, and the other view.
    browser.choose("zoom", "8");
    assert_eq!(browser.place("#stage")[2..], [8.0 * 40.0 + 2.0, 8.0 * 32.0 + 2.0]);
    browser.choose("view", "cornell, orbit, 24x32");
    let other = enlarged(&pictures, ["cornell, orbit, 24x32", "reference"], "src", zoom);
    assert!(apart(&stage(&mut browser), &other, [0, other.width()]) <= ROUNDING);
    assert_eq!(browser.problems, [""; 0]);
}

#[test]
fn tables_are_sorted_and_all_fits_in_light_and_dark() {
    let (place, _) = page();
    let mut browser = Browser::open(&place.path("a/page.html"), [1280, 900]);
    assert_eq!(browser.eval("document.querySelectorAll('table').length"), 2, "searches and cells");
    let column = |browser: &mut Browser, nth: u32| -> Vec<String> {
        let script = format!(
            "[...document.querySelectorAll('table')[1].tBodies[0].rows].map(r => r.cells[{nth}].textContent)"
        );
        let found = browser.eval(&script);
        found
            .as_array()
            .expect("a list")
            .iter()
            .map(|text| text.as_str().expect("a text").to_owned())
            .collect()
    };
    // Of four cells in two views, each with the mean over its seeds; `flip` is the ninth column.
    let heads = browser.eval("document.querySelectorAll('table')[1].tHead.rows[0].cells[8].textContent");
    assert_eq!(heads, "flip");
    let numbers = |browser: &mut Browser| -> Vec<f64> {
        column(browser, 8).iter().map(|text| text.parse().expect("a number")).collect()
    };
    let unsorted = numbers(&mut browser);
    assert_eq!(unsorted.len(), 8);
    let head = ".scroll:last-of-type th:nth-child(9)";
    browser.click(head);
    let up = numbers(&mut browser);
    assert!(up.is_sorted() && up != unsorted, "{unsorted:?} became {up:?}");
    browser.click(head);
    assert!(numbers(&mut browser).iter().rev().is_sorted());
    browser.click(".scroll:last-of-type th:nth-child(1)");
    let graphs = column(&mut browser, 0);
    assert!(graphs.is_sorted() && graphs[0] == "epi", "{graphs:?}");

    for dark in [false, true] {
        browser.prefer_dark(dark);
        for width in [1280, 420] {
            browser.resize([width, 900]);
            browser.eval("scrollTo(0, 0)");
            let shot = browser.screenshot();
            let back = shot.get_pixel(2, 2).0.map(u32::from).iter().sum::<u32>() / 3;
            assert!(if dark { back < 50 } else { back > 230 }, "dark: {dark}, but the page is {back}");
            // Letters of the title stand out.
            let most = shot.enumerate_pixels().filter(|(_, y, _)| *y < 100);
            let most = most.map(|(.., pixel)| u32::from(pixel[1]).abs_diff(back)).max();
            assert!(most > Some(150), "the title is hardly seen: {most:?}");
            let wide = browser.eval("document.documentElement.scrollWidth");
            assert!(wide.as_u64() <= Some(width.into()), "the page is {wide} wide in a window of {width}");
        }
    }
    assert_eq!(browser.problems, [""; 0]);
}

#[test]
fn texts_of_figures_fit() {
    let (place, _) = page();
    for (name, options) in [
        ("wide.svg", ""),
        ("narrow.svg", "--width 85"),
        ("crops.svg", "--crop 2,3,16x8 --crop 9,9,4x4 --crop 1,1,4x6"),
    ] {
        place.succeeds(&format!("tradeoff t.ron --out a --collect --figure {name} {options}"));
        let mut browser = Browser::open(&place.path(name), [1280, 1200]);
        let boxes = browser.eval(
            "(() => { const whole = document.documentElement.viewBox.baseVal; \
             return [[0, 0, whole.width, whole.height], \
             ...[...document.querySelectorAll('text, image')].map(element => { const box = element.getBBox(); return [box.x, box.y, box.width, box.height, element.tagName]; })]; })()",
        );
        let boxes: Vec<([f64; 4], bool)> = boxes
            .as_array()
            .expect("a list")
            .iter()
            .map(|of| (std::array::from_fn(|side| of[side].as_f64().expect("a number")), of[4] == "text"))
            .collect();
        let ([_, _, width, height], _) = boxes[0];
        assert!(boxes.len() > 20, "{name} has {} texts and pictures", boxes.len());
        // Letters have some room above and below in their boxes.
        let overlap = |[ax, ay, aw, ah]: [f64; 4], [bx, by, bw, bh]: [f64; 4]| {
            let across = (ax + aw).min(bx + bw) - ax.max(bx);
            across > 0.5 && (ay + ah).min(by + bh) - ay.max(by) > 2.0
        };
        for (nth, (of, is_text)) in boxes.iter().enumerate().skip(1) {
            let [x, y, w, h] = *of;
            let is_in = x > -0.5 && y > -2.0 && x + w < width + 0.5 && y + h < height + 2.0;
            assert!(is_in, "{name}: {of:?} leaves the figure of {width} x {height}");
            let others = boxes[1..nth].iter().filter(|(_, is_other)| *is_text || *is_other);
            for (other, _) in others {
                assert!(!overlap(*of, *other), "{name}: {of:?} and {other:?} overlap");
            }
        }
        assert_eq!(browser.problems, [""; 0]);
    }
}

#[test]
fn problems_of_a_page_are_found() {
    let place = Place::new();
    place.write("p.html", "<script>nothing.at.all;</script><img src='http://127.0.0.1:9/x.png'>");
    let browser = Browser::open(&place.path("p.html"), [300, 200]);
    let found = |part: &str| browser.problems.iter().any(|problem| problem.contains(part));
    assert!(found("nothing is not defined") && found("127.0.0.1"), "{:?}", browser.problems);
}
