//! Just enough of SVG for plots and for drawings of graphs.

/// The alignment of a text to its point.
#[derive(Clone, Copy)]
pub enum Anchor {
    /// It begins there.
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

/// Size and colour of a text; bold or not.
#[derive(Clone, Copy)]
pub struct Font {
    /// Height, in the unit of the drawing.
    pub size: f64,
    /// Colour.
    pub color: &'static str,
    /// True if it is bold.
    pub bold: bool,
}

/// The fonts of all texts: the first one that is there.
const FONTS: &str = "Helvetica, Arial, sans-serif";

/// A picture that grows downwards.
#[derive(Default)]
pub struct Svg {
    body: String,
}

impl Svg {
    /// A filled rectangle.
    pub fn rect(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], color: &str) {
        self.body += &format!(
            "<rect x=\"{x:.2}\" y=\"{y:.2}\" width=\"{width:.2}\" height=\"{height:.2}\" fill=\"{color}\"/>\n"
        );
    }

    /// The frame of a rectangle; half of its width is outside.
    pub fn outline(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], color: &str, stroke: f64) {
        self.body += &format!(
            "<rect x=\"{x:.2}\" y=\"{y:.2}\" width=\"{width:.2}\" height=\"{height:.2}\" fill=\"none\" \
             stroke=\"{color}\" stroke-width=\"{stroke}\"/>\n"
        );
    }

    /// A picture, stretched to this size. `url` may hold the picture itself: `data:image/png;base64,...`.
    pub fn image(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], url: &str) {
        self.body += &format!(
            "<image x=\"{x:.2}\" y=\"{y:.2}\" width=\"{width:.2}\" height=\"{height:.2}\" \
             preserveAspectRatio=\"none\" href=\"{url}\"/>\n"
        );
    }

    /// A line.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], color: &str, width: f64) {
        self.polyline(&[from, to], color, width);
    }

    /// Lines from point to point.
    pub fn polyline(&mut self, points: &[[f64; 2]], color: &str, width: f64) {
        self.stroke("", points, color, width);
    }

    /// Dashes from point to point.
    pub fn dashed(&mut self, points: &[[f64; 2]], color: &str, width: f64) {
        self.stroke(" stroke-dasharray=\"6 4\"", points, color, width);
    }

    fn stroke(&mut self, dashes: &str, points: &[[f64; 2]], color: &str, width: f64) {
        self.body += &format!(
            "<polyline{dashes} points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\" \
             stroke-linejoin=\"round\"/>\n",
            coordinates(points)
        );
    }

    /// A filled shape.
    pub fn polygon(&mut self, points: &[[f64; 2]], color: &str) {
        self.body += &format!("<polygon points=\"{}\" fill=\"{color}\"/>\n", coordinates(points));
    }

    /// A dot.
    pub fn dot(&mut self, [x, y]: [f64; 2], radius: f64, color: &str) {
        self.body += &format!("<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\" fill=\"{color}\"/>\n");
    }

    /// A circle.
    pub fn ring(&mut self, [x, y]: [f64; 2], radius: f64, color: &str, width: f64) {
        self.body += &format!(
            "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\" fill=\"none\" stroke=\"{color}\" \
             stroke-width=\"{width}\"/>\n"
        );
    }

    /// A line of text; `y` is its baseline.
    pub fn text(&mut self, [x, y]: [f64; 2], text: &str, anchor: Anchor, font: Font) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let weight = if font.bold { " font-weight=\"600\"" } else { "" };
        self.body += &format!(
            "<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{}\" fill=\"{}\" text-anchor=\"{anchor}\"{weight}>{}</text>\n",
            font.size,
            font.color,
            escaped(text)
        );
    }

    /// The file, `width` by `height` pixels on white.
    pub fn finish(self, [width, height]: [f64; 2]) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"{FONTS}\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{}</svg>\n",
            self.body
        )
    }

    /// The file of a figure that is printed: all lengths are points, 1/72 inch, and nothing is behind it. `about` is its
    /// description, which is not drawn.
    pub fn finish_print(self, [width, height]: [f64; 2], about: &str) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.2}pt\" height=\"{height:.2}pt\" \
             viewBox=\"0 0 {width:.2} {height:.2}\" font-family=\"{FONTS}\">\n<desc>{}</desc>\n{}</svg>\n",
            escaped(about),
            self.body
        )
    }
}

fn coordinates(points: &[[f64; 2]]) -> String {
    let points: Vec<String> = points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
    points.join(" ")
}

/// Text with XML's special characters escaped.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_break_the_file() {
        let mut svg = Svg::default();
        let font = Font { size: 10.0, color: "black", bold: false };
        svg.text([0.0, 0.0], "<script> & co", Anchor::Start, font);
        let text = svg.finish([10.0, 10.0]);
        assert!(text.contains("&lt;script&gt; &amp; co") && !text.contains("<script>"));
    }
}
