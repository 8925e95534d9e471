//! Meanings of the stages' port values. Pictures choose how to show a port by its meaning, and the inspector, the
//! gallery and the bench use it to find the ports that they need, regardless of the ports' names. Its rules say what the
//! values may be, for `--watch`.

use epigraph_core::Rule;

use crate::shared::{
    cloud::{NO_POINT, NOT_DRAWN},
    edge_pixel::{AREA_SHIFT, COMPLEX, PIXEL_AREA},
    requests::{HIT_BACKGROUND, NO_PIXEL, UNKNOWN, VIEW_PREDICTED},
    segments::{BORDER, NO_FACE},
};

/// Bits of infinity: the distance of nothing.
const NOTHING: u32 = f32::INFINITY.to_bits();
/// Not negative and finite.
const AMOUNT: Rule = Rule::floats(0.0, f32::MAX);
/// The index of a point.
const POINT: Rule = Rule::index_of("points").or(NO_POINT);
/// The index of a pixel.
const PIXEL: Rule = Rule::pixel_index().or(NO_PIXEL).of("pixel");
/// The number of a view.
const VIEW: Rule = Rule::wholes(0, VIEW_PREDICTED as i64).of("view");

epigraph_core::meanings! {
    /// The points.
    POINTS = "points", [
        Rule::floats(0.0, 1.0).of("position").lanes(3, 4),
        Rule::pixel_index().or(NOT_DRAWN).of("image_id"),
        Rule::bits(19, 5, 0).of("meta"),
    ];
    /// What to sample; entries without a pixel are empty.
    REQUESTS = "requests", [PIXEL, POINT.of("reuse"), VIEW];
    /// What was seen; entries without a hit are empty.
    SAMPLES = "samples", [
        Rule::wholes(0, HIT_BACKGROUND as i64).of("hit"),
        AMOUNT.of("radiance"),
        PIXEL,
        POINT.of("reuse"),
        VIEW,
    ];
    /// The slot of each sample, 0xFFFFFFFF for none.
    SLOT = "slot", [POINT];
    /// The mean albedo of each point's samples, 16 bits a channel.
    POINT_ALBEDOS = "albedos of points";
    /// The number of samples that entered the cloud.
    ARRIVED = "arrived samples", [Rule::count_of("samples")];
    /// Live points of each whole age.
    AGES = "points by age", [Rule::count_of("points")];
    /// Frame number + 1 in which the sample of each slot came, 0 if unknown.
    DATE = "date";
    /// The share by which the light of each tile has changed, as its samples tell, 0 if it has not.
    LIGHT_SHIFT = "light shift", [Rule::floats(0.0, 1.0)];

    /// The point that each pixel shows, 0xFFFFFFFF for none.
    ID = "id", [POINT];
    /// The point that each pixel shows before reachability drops some, 0xFFFFFFFF for none.
    KEPT = "kept id", [POINT];
    /// Distance along the camera's axis, metres; as floats, or as their bits.
    DEPTH = "depth", [AMOUNT.or(NOTHING)];
    /// The point's cell in the pixel, row by row.
    CELL = "cell", [Rule::wholes(0, 255)];
    /// The age of the point that each pixel shows, 0 to 255.
    AGE = "age";
    /// Age in frames of the point that each pixel shows.
    FRAMES_AGO = "frames ago";

    /// Crossings with the left (bits 0 to 7) and top (8 to 15) side of each pixel.
    CROSSINGS = "crossings";
    /// Where in the pixel an edge turns: 0 if it does not, else 0x10000 | y << 8 | x in 1/16 pixel.
    TURN = "turn", [Rule::wholes(0, 0x1_1010)];
    /// Class and regions of each pixel.
    CLASS = "class", [
        Rule::bits(0, 2, COMPLEX),
        Rule::bits(AREA_SHIFT, 10, PIXEL_AREA),
        Rule::bits(29, 3, 0),
    ];
    /// Which regions of each pixel join which regions of its eight neighbours.
    JOINS = "joins";
    /// Which of the 24 pixels around it the primary region of each pixel reaches.
    REACH = "reach", [Rule::bits(24, 8, 0)];

    /// The triangle that each pixel shows, 0xFFFFFFFF for none.
    FACE = "face", [Rule::index_of("faces").or(NO_FACE)];
    /// Unit normals on an octahedron, two signed 16-bit integers; 0x80008000 for none.
    NORMAL = "normal";
    /// The share of light that a surface scatters; alpha 1, or all 0 for none.
    ALBEDO = "albedo", [AMOUNT];
    /// Albedos as the squares of 8 bits a channel, red in the low ones; 0 for none.
    ALBEDO_CODE = "albedo code", [Rule::bits(24, 8, 0)];
    /// Radiance that a surface emits.
    EMISSION = "emission", [AMOUNT];
    /// Perceptual roughness, 0 to 1.
    ROUGHNESS = "roughness", [Rule::floats(0.0, 1.0)];
    /// Where what a pixel shows was in the last frame's image, minus where it is, in pixels; 1e9 for nowhere.
    MOTION = "motion";

    /// Linear radiance.
    RADIANCE = "radiance", [AMOUNT];
    /// Variance of a colour's luminance; negative where it is unknown.
    VARIANCE = "variance", [AMOUNT.or(UNKNOWN.to_bits())];
    /// The picture, sRGB-encoded.
    PICTURE = "picture";
    /// The radiance that is shown as white, found from the picture; 0 before there is light in it.
    WHITE = "white", [AMOUNT];
    /// How much a sample is worth, 0 to 255.
    PRIORITY = "priority", [Rule::wholes(0, 255)];
    /// Where in the pixel the next sample should go, in 1/65536 of it: x low, y high.
    AIM = "aim";
    /// 1 where the predicted view has a point in 4x4 pixels, else 0.
    OCCUPANCY = "occupancy", [Rule::wholes(0, 1)];

    /// Positions, metres.
    VERTICES = "vertices";
    /// Three vertices and the object of each triangle.
    FACES = "faces", [Rule::index_of("vertices").lanes(0, 3)];
    /// Normals at the corners, material and body of each triangle.
    CORNERS = "corners";
    /// What each material looks like.
    LOOKS = "looks", [AMOUNT.of("albedo"), AMOUNT.of("emission"), Rule::floats(0.0, 1.0).of("roughness")];
    /// Normals of the triangles.
    NORMALS = "normals";
    /// Vertices, faces and kind of every edge.
    EDGES = "edges", [
        Rule::index_of("vertices").of("vertices"),
        Rule::index_of("faces").or(NO_FACE).of("faces"),
        Rule::wholes(0, BORDER as i64).of("kind"),
    ];
    /// Bits of the edges that are silhouettes.
    DRAWN = "drawn edges";
    /// Edges of objects.
    SILHOUETTES = "silhouettes";
    /// Boundaries of shadows.
    SHADOWS = "shadow boundaries";
    /// The number of elements of a list that count.
    COUNT = "count";

    /// The blocks of the nodes at hand.
    STREAM_WORDS = "blocks";
    /// The nodes of the cut.
    STREAM_NODES = "nodes of the cut";
    /// The pools of the cut.
    STREAM_POOLS = "pools of the cut";
    /// Workgroups, points, vertices, pools and nodes of the cut, and bytes of new blocks.
    STREAM_NUMBERS = "numbers of the cut";

    /// How each body has moved since the last frame.
    MOVES = "moves";
    /// The scene's lights.
    LIGHTS = "lights", [
        AMOUNT.of("power"),
        Rule::floats(0.0, 1.0).of("uniform_share"),
        AMOUNT.of("radius"),
    ];
    /// The boxes of the bodies.
    BLOCKERS = "boxes";
}
