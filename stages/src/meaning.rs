//! Meanings of the stages' port values. Pictures choose how to show a port by its meaning, and the inspector, the
//! gallery and the bench use it to find the ports that they need, regardless of the ports' names.

epigraph_core::meanings! {
    /// The points.
    POINTS = "points";
    /// What to sample; entries without a pixel are empty.
    REQUESTS = "requests";
    /// What was seen; entries without a hit are empty.
    SAMPLES = "samples";
    /// The slot of each sample, 0xFFFFFFFF for none.
    SLOT = "slot";
    /// The number of samples that entered the cloud.
    ARRIVED = "arrived samples";
    /// Live points of each whole age.
    AGES = "points by age";
    /// Frame number + 1 in which the sample of each slot came, 0 if unknown.
    DATE = "date";

    /// The point that each pixel shows, 0xFFFFFFFF for none.
    ID = "id";
    /// The point that each pixel shows before reachability drops some, 0xFFFFFFFF for none.
    KEPT = "kept id";
    /// Distance along the camera's axis, metres; as floats, or as their bits.
    DEPTH = "depth";
    /// The point's cell in the pixel, row by row.
    CELL = "cell";
    /// The age of the point that each pixel shows, 0 to 255.
    AGE = "age";
    /// Age in frames of the point that each pixel shows.
    FRAMES_AGO = "frames ago";

    /// Crossings with the left (bits 0 to 7) and top (8 to 15) side of each pixel.
    CROSSINGS = "crossings";
    /// Where in the pixel an edge turns: 0 if it does not, else 0x10000 | y << 8 | x in 1/16 pixel.
    TURN = "turn";
    /// Class and regions of each pixel.
    CLASS = "class";
    /// Which regions of each pixel join which regions of its eight neighbours.
    JOINS = "joins";
    /// Which of the 24 pixels around it the primary region of each pixel reaches.
    REACH = "reach";

    /// Linear radiance.
    RADIANCE = "radiance";
    /// The picture, sRGB-encoded.
    PICTURE = "picture";
    /// The radiance that is shown as white, found from the picture; 0 before there is light in it.
    WHITE = "white";
    /// How much a sample is worth, 0 to 255.
    PRIORITY = "priority";
    /// Where in the pixel the next sample should go, in 1/65536 of it: x low, y high.
    AIM = "aim";
    /// 1 where the predicted view has a point in 4x4 pixels, else 0.
    OCCUPANCY = "occupancy";

    /// Positions, metres.
    VERTICES = "vertices";
    /// Three vertices and the object of each triangle.
    FACES = "faces";
    /// Normals of the triangles.
    NORMALS = "normals";
    /// Vertices, faces and kind of every edge.
    EDGES = "edges";
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
    LIGHTS = "lights";
    /// The boxes of the bodies.
    BLOCKERS = "boxes";
}
