//! Shapes and instances as bytes, as `docs/vts.md` has them.

use glam::{DVec3, Quat, Vec3};

use super::{
    bits::{BitReader, BitWriter, bytes_of},
    shape::{Grid, Instance, MOST_BITS, Repeats, Shape, bits_of},
};

const NORMALS: u32 = 1;
const COLORS: u32 = 2;
const MATERIALS: u32 = 4;

const HEADER: usize = 20;
const RECORD: usize = 32;
const INSTANCE: usize = 28;

/// How far the squared length of a stored rotation may be from 1: it was rounded to single precision.
const UNIT: f32 = 1e-5;

/// Why bytes are no shapes and instances.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BlockError {
    /// The bytes end early.
    #[error("the repeats end at byte {length}, before the end of {part}: they are cut off")]
    Short {
        /// The number of bytes.
        length: usize,
        /// What is cut off.
        part: String,
    },
    /// There are bytes behind the last shape.
    #[error("{0} bytes follow the last shape of the repeats")]
    Long(usize),
    /// The bytes have changed since they were written.
    #[error("the checksum of the repeats is wrong: they are damaged")]
    Checksum,
    /// A number cannot be what it is.
    #[error("{part} of the repeats: {cause}")]
    Value {
        /// The header, a shape or an instance.
        part: String,
        /// What is wrong.
        cause: String,
    },
}

/// What shapes and instances take in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bytes {
    /// The header and the shapes' records.
    pub records: usize,
    /// Rotations, translations and materials.
    pub instances: usize,
    /// Positions.
    pub vertices: usize,
    /// Normals and colours.
    pub attributes: usize,
    /// Triangles.
    pub triangles: usize,
}

impl Bytes {
    /// What the positions of all vertices take, without their triangles and colours.
    pub fn points(&self) -> usize {
        self.records + self.instances + self.vertices
    }

    /// The length of [`Repeats::to_bytes`].
    pub fn total(&self) -> usize {
        self.points() + self.attributes + self.triangles
    }
}

/// The bits that name one of so many vertices.
fn index_bits(vertices: usize) -> u32 {
    bits_of((vertices as u32).saturating_sub(1))
}

impl Repeats {
    /// What the parts of [`Repeats::to_bytes`] take.
    pub fn bytes(&self) -> Bytes {
        let material = if self.flags() & MATERIALS == 0 { 0 } else { 4 };
        let mut bytes = Bytes {
            records: HEADER + self.shapes.len() * RECORD,
            instances: self.instances.len() * (INSTANCE + material),
            ..Bytes::default()
        };
        for shape in &self.shapes {
            let vertices = shape.vertex_count();
            let attributes = usize::from(shape.normals.is_some()) + usize::from(shape.colors.is_some());
            bytes.vertices += bytes_of(vertices, shape.bits());
            bytes.attributes += 4 * attributes * vertices;
            bytes.triangles += bytes_of(3 * shape.triangles.len(), index_bits(vertices));
        }
        bytes
    }

    /// All shapes have the same attributes, and all instances a material or none.
    fn flags(&self) -> u32 {
        let shape = self.shapes.first();
        let has = |flag, is: Option<bool>| if is == Some(true) { flag } else { 0 };
        has(NORMALS, shape.map(|shape| shape.normals.is_some()))
            | has(COLORS, shape.map(|shape| shape.colors.is_some()))
            | has(MATERIALS, self.instances.first().map(|instance| instance.material.is_some()))
    }

    /// Shapes and instances as bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.bytes().total());
        let word = |bytes: &mut Vec<u8>, word: u32| bytes.extend(word.to_le_bytes());
        let floats =
            |bytes: &mut Vec<u8>, floats: &[f32]| bytes.extend(floats.iter().flat_map(|f| f.to_le_bytes()));
        word(&mut bytes, 0);
        for number in [self.flags(), self.shapes.len() as u32, self.instances.len() as u32] {
            word(&mut bytes, number);
        }
        floats(&mut bytes, &[self.deviation]);
        for (shape, instances) in self.instances_by_shape() {
            for count in [shape.vertex_count(), shape.triangles.len(), instances.len()] {
                word(&mut bytes, count as u32);
            }
            let Grid { low, step, bits: [x, y, z] } = shape.grid;
            floats(&mut bytes, &[low.x, low.y, low.z, step]);
            bytes.extend([x as u8, y as u8, z as u8, 0]);
        }
        for instance in &self.instances {
            floats(&mut bytes, &instance.rotation.to_array());
            floats(&mut bytes, &instance.translation.to_array());
            instance.material.iter().for_each(|&material| word(&mut bytes, material));
        }
        for shape in &self.shapes {
            let mut cells = BitWriter::new(&mut bytes);
            for cell in &shape.cells {
                cell.iter().zip(shape.grid.bits).for_each(|(&along, bits)| cells.write(along, bits));
            }
            cells.finish();
            shape.normals.iter().flatten().for_each(|&normal| word(&mut bytes, normal));
            shape.colors.iter().flatten().for_each(|color| bytes.extend(color));
            let bits = index_bits(shape.vertex_count());
            let mut corners = BitWriter::new(&mut bytes);
            shape.triangles.iter().flatten().for_each(|&vertex| corners.write(vertex, bits));
            corners.finish();
        }
        let checksum = crc32fast::hash(&bytes[4..]);
        bytes[..4].copy_from_slice(&checksum.to_le_bytes());
        bytes
    }

    /// Shapes and instances from the bytes of [`Repeats::to_bytes`]. Memory grows with the number of bytes.
    ///
    /// # Errors
    /// The bytes are cut off or damaged, or are no shapes and instances.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, BlockError> {
        let mut reader = Reader { all: bytes, offset: 0 };
        let [checksum, flags, shape_count, instance_count] = reader.words("the header")?;
        let [deviation] = reader.floats("the header")?;
        if crc32fast::hash(&bytes[4..]) != checksum {
            return Err(BlockError::Checksum);
        }
        let header = |cause: &str| Err(value("the header", cause));
        if flags & !(NORMALS | COLORS | MATERIALS) != 0 {
            return header(&format!("its flags are {flags:#x}, but there are only 1, 2 and 4"));
        }
        if !(deviation >= 0.0 && deviation.is_finite()) {
            return header(&format!("{deviation} is no distance"));
        }
        // The records are in the bytes before memory is allocated for them.
        let mut records =
            reader.part((shape_count as usize).checked_mul(RECORD), "the records of the shapes")?;
        let records: Vec<Record> =
            (0..shape_count).map(|shape| Record::read(&mut records, shape)).collect::<Result<_, _>>()?;
        if records.is_empty() {
            return header("it has no shapes");
        }
        let counted: u64 = records.iter().map(|record| u64::from(record.instances)).sum();
        if counted != u64::from(instance_count) {
            return header(&format!("it has {instance_count} instances, its shapes {counted}"));
        }

        let length = INSTANCE + if flags & MATERIALS == 0 { 0 } else { 4 };
        let mut placed = reader.part((instance_count as usize).checked_mul(length), "the instances")?;
        let mut instances = Vec::with_capacity(instance_count as usize);
        for (shape, record) in (0..).zip(&records) {
            for _ in 0..record.instances {
                instances.push(read_instance(&mut placed, instances.len(), shape, flags)?);
            }
        }
        let shapes = (0..).zip(records).map(|(index, record)| record.shape(&mut reader, index, flags));
        let shapes = shapes.collect::<Result<_, _>>()?;
        match reader.all.len() - reader.offset {
            0 => Ok(Self { shapes, instances, deviation, origin: DVec3::ZERO }),
            rest => Err(BlockError::Long(rest)),
        }
    }
}

fn value(part: impl ToString, cause: impl ToString) -> BlockError {
    BlockError::Value { part: part.to_string(), cause: cause.to_string() }
}

/// A shape without its vertices.
struct Record {
    vertices: usize,
    triangles: usize,
    instances: u32,
    grid: Grid,
}

impl Record {
    fn read(reader: &mut Reader, index: u32) -> Result<Self, BlockError> {
        let part = format!("shape {index}");
        let [vertices, triangles, instances] = reader.words(&part)?;
        let [x, y, z, step] = reader.floats(&part)?;
        let [packed] = reader.words(&part)?;
        let [bits @ .., zero] = packed.to_le_bytes().map(u32::from);
        let grid = Grid { low: Vec3::new(x, y, z), step, bits };
        // Each vertex is a corner of a triangle, and triangles take bytes.
        if vertices < 3 || u64::from(vertices) > 3 * u64::from(triangles) || instances == 0 {
            let cause = format!(
                "{triangles} triangles cannot have {vertices} vertices, nor be {instances} times there"
            );
            return Err(value(part, cause));
        }
        let far = grid.position([(1 << MOST_BITS) - 1; 3]);
        if bits.iter().any(|&bits| bits > MOST_BITS) || zero != 0 || !(step > 0.0 && far.is_finite()) {
            return Err(value(part, "its grid is not one of single precision"));
        }
        Ok(Self { vertices: vertices as usize, triangles: triangles as usize, instances, grid })
    }

    /// The shape from its vertices and triangles.
    fn shape(self, reader: &mut Reader, index: u32, flags: u32) -> Result<Shape, BlockError> {
        let Self { vertices, triangles, grid, .. } = self;
        let part = format!("shape {index}");
        let bits = index_bits(vertices);
        // All of the shape is in the bytes before memory is allocated for any of it.
        let cells = bytes_of(vertices, grid.bits.iter().sum());
        let corners = bytes_of(3 * triangles, bits);
        let word = |flag| if flags & flag == 0 { 0 } else { 4 * vertices };
        let mut of_shape = reader.part(Some(cells + word(NORMALS) + word(COLORS) + corners), &part)?;

        let mut cells = BitReader::new(of_shape.part(Some(cells), &part)?.all);
        let cells = (0..vertices).map(|_| grid.bits.map(|bits| cells.read(bits))).collect();
        let mut each = |flag| -> Result<Option<Vec<[u8; 4]>>, BlockError> {
            let words = of_shape.part(Some(word(flag)), &part)?;
            Ok((flags & flag != 0).then(|| words.all.as_chunks().0.to_vec()))
        };
        let normals = each(NORMALS)?.map(|words| words.into_iter().map(u32::from_le_bytes).collect());
        let colors = each(COLORS)?;
        let mut corners = BitReader::new(of_shape.part(Some(corners), &part)?.all);
        let mut named = Vec::with_capacity(triangles);
        for triangle in 0..triangles {
            let [a, b, c] = [0; 3].map(|_| corners.read(bits));
            if a.max(b).max(c) as usize >= vertices || a == b || b == c || c == a {
                let cause =
                    format!("triangle {triangle} has corners {a}, {b} and {c} among {vertices} vertices");
                return Err(value(part, cause));
            }
            named.push([a, b, c]);
        }
        Ok(Shape { grid, cells, normals, colors, triangles: named })
    }
}

fn read_instance(reader: &mut Reader, index: usize, shape: u32, flags: u32) -> Result<Instance, BlockError> {
    let part = format!("instance {index}");
    let rotation = Quat::from_array(reader.floats(&part)?);
    let translation = Vec3::from_array(reader.floats(&part)?);
    let material = if flags & MATERIALS == 0 { None } else { Some(reader.words::<1>(&part)?[0]) };
    let unit = (rotation.length_squared() - 1.0).abs() <= UNIT;
    if !(unit && translation.is_finite()) {
        return Err(value(part, "it is not rotated by a unit quaternion, or not moved by finite numbers"));
    }
    Ok(Instance { shape, rotation, translation, material })
}

/// Bytes while they are read.
struct Reader<'a> {
    all: &'a [u8],
    offset: usize,
}

impl<'a> Reader<'a> {
    /// The next bytes, to be read by themselves; `None` for a length that no number holds.
    fn part(&mut self, length: Option<usize>, part: &str) -> Result<Reader<'a>, BlockError> {
        let all = length.and_then(|length| self.all[self.offset..].get(..length));
        let all = all.ok_or_else(|| BlockError::Short { length: self.all.len(), part: part.into() })?;
        self.offset += all.len();
        Ok(Reader { all, offset: 0 })
    }

    fn words<const N: usize>(&mut self, part: &str) -> Result<[u32; N], BlockError> {
        let bytes = self.part(Some(4 * N), part)?.all;
        let (words, _) = bytes.as_chunks();
        Ok(std::array::from_fn(|i| u32::from_le_bytes(words[i])))
    }

    fn floats<const N: usize>(&mut self, part: &str) -> Result<[f32; N], BlockError> {
        Ok(self.words(part)?.map(f32::from_bits))
    }
}
