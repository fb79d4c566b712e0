//! The height field that flights above terrain follow: a grid of node heights, read in place from
//! `field.bin`.
//!
//! Little endian: magic `FLKFIELD`, version u16, columns u16, rows u16, 0 u16, east and north of
//! the first node f32, metres between nodes f32, then one i16 per node (decimetres up in the
//! mission frame, rows from south to north), and a CRC-32 of all before it. Heights between nodes
//! are interpolated bilinearly; beyond the border the height is that of the nearest point of the
//! border. The desktop gives each node the height of the highest ground near it: within 1.5 node
//! spacings, plus the distance by which a vehicle may be beside its path. Then it raises nodes
//! until no slope is too steep. So a path that is above the field at samples half a node spacing
//! apart is above the ground everywhere.

pub mod follow;

use libm::{floorf, fmaxf, fminf};

use crate::file::{CRC32, FileError};
use crate::geo::Flat;

/// First eight bytes of a height-field file.
pub const MAGIC: [u8; 8] = *b"FLKFIELD";
/// Version of the file format that is written and read.
pub const VERSION: u16 = 1;
/// Length of the header, the bytes before the first node.
pub const HEADER_LEN: usize = 28;
/// Most nodes of a field, so that the file fits a board's roadmap slot.
pub const MAX_NODES: usize = 1 << 16;
/// Unit of a stored node height, metres.
pub const HEIGHT_STEP_M: f32 = 0.1;
/// Bytes of the CRC-32 at the end of the file.
const CRC_LEN: usize = 4;

/// Position, spacing and number of a height field's nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldShape {
    /// The south-western node, metres east and north in the mission frame.
    pub south_west: Flat,
    /// Distance from one node to the next, metres.
    pub cell_m: f32,
    /// Nodes from west to east, at least 2.
    pub columns: u16,
    /// Nodes from south to north, at least 2.
    pub rows: u16,
}

impl FieldShape {
    /// Number of nodes.
    pub fn node_count(&self) -> usize {
        usize::from(self.columns) * usize::from(self.rows)
    }

    /// Length of the file in bytes.
    pub fn encoded_len(&self) -> usize {
        HEADER_LEN + 2 * self.node_count() + CRC_LEN
    }

    /// Checks the numbers and places of the nodes.
    fn check(&self) -> Result<(), FileError> {
        if self.columns < 2 || self.rows < 2 || self.node_count() > MAX_NODES {
            return Err(FileError::Header("number of nodes"));
        }
        let sound = |value: f32| libm::fabsf(value) <= 1e6;
        if !(self.cell_m >= 0.1
            && self.cell_m <= 1e4
            && sound(self.south_west.x)
            && sound(self.south_west.y))
        {
            return Err(FileError::Header("place of nodes"));
        }
        Ok(())
    }
}

/// A checked height field over borrowed bytes.
#[derive(Clone, Copy, Debug)]
pub struct FieldView<'a> {
    /// Place, spacing and numbers of the nodes.
    shape: FieldShape,
    /// Height of each node in the file's encoding: little-endian i16, decimetres; row by row from
    /// the south, each row from west to east.
    nodes: &'a [[u8; 2]],
    /// Height of the highest node, decimetres.
    highest_dm: i16,
    /// The CRC-32 at the end of the file.
    crc: u32,
}

impl<'a> FieldView<'a> {
    /// Checks the file, which must be exactly as long as its header states, and returns a view of
    /// it.
    ///
    /// # Errors
    /// The reason why the bytes are not a valid height field.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, FileError> {
        let Some((header, rest)) = bytes.split_first_chunk::<HEADER_LEN>() else {
            return Err(FileError::Truncated);
        };
        let shape = parse_shape(header)?;
        if bytes.len() != shape.encoded_len() {
            return Err(if bytes.len() < shape.encoded_len() {
                FileError::Truncated
            } else {
                FileError::Length
            });
        }
        let Some((nodes, crc)) = rest.split_last_chunk::<CRC_LEN>() else {
            return Err(FileError::Truncated);
        };
        let crc = u32::from_le_bytes(*crc);
        if CRC32.checksum(&bytes[..bytes.len() - CRC_LEN]) != crc {
            return Err(FileError::Crc);
        }
        let nodes = nodes.as_chunks().0;
        let highest_dm = nodes.iter().map(|node| i16::from_le_bytes(*node)).max().unwrap_or(0);
        Ok(Self { shape, nodes, highest_dm, crc })
    }

    /// Position, spacing and number of the nodes.
    pub fn shape(&self) -> &FieldShape {
        &self.shape
    }

    /// The CRC-32 at the end of the file.
    pub fn crc(&self) -> u32 {
        self.crc
    }

    /// Height of the highest node, metres up in the mission frame.
    pub fn highest_m(&self) -> f32 {
        f32::from(self.highest_dm) * HEIGHT_STEP_M
    }

    /// Height of the field at `place`, metres up in the mission frame; beyond the border the height
    /// of the border's nearest point.
    pub fn height_at(&self, place: &Flat) -> f32 {
        let axis = |at: f32, low: f32, count: u16| {
            let most = f32::from(count - 1);
            let cells = fmaxf(fminf((at - low) / self.shape.cell_m, most), 0.0);
            let first = fminf(floorf(cells), most - 1.0);
            (first as usize, cells - first)
        };
        let (column, east) = axis(place.x, self.shape.south_west.x, self.shape.columns);
        let (row, north) = axis(place.y, self.shape.south_west.y, self.shape.rows);
        let node = |column: usize, row: usize| {
            let index = row * usize::from(self.shape.columns) + column;
            self.nodes.get(index).map_or(0.0, |node| f32::from(i16::from_le_bytes(*node)))
        };
        let across = |row: usize| node(column, row) * (1.0 - east) + node(column + 1, row) * east;
        (across(row) * (1.0 - north) + across(row + 1) * north) * HEIGHT_STEP_M
    }
}

/// The file length that a header states. Refuses a version that this code does not read.
///
/// # Errors
/// The bytes are not a field's header, the version is unknown, or number or position of the nodes
/// is out of range.
pub fn declared_len(head: &[u8; HEADER_LEN]) -> Result<usize, FileError> {
    Ok(parse_shape(head)?.encoded_len())
}

/// Reads and checks a file's header.
fn parse_shape(header: &[u8; HEADER_LEN]) -> Result<FieldShape, FileError> {
    if header[..8] != MAGIC {
        return Err(FileError::Magic);
    }
    let word = |at: usize| u16::from_le_bytes([header[at], header[at + 1]]);
    let number = |at: usize| f32::from_bits(u32::from(word(at)) | u32::from(word(at + 2)) << 16);
    if word(8) != VERSION {
        return Err(FileError::Version(word(8)));
    }
    let low = Flat::new(number(16), number(20));
    let shape =
        FieldShape { south_west: low, cell_m: number(24), columns: word(10), rows: word(12) };
    shape.check()?;
    Ok(shape)
}

/// Writes a height-field file: node heights in decimetres, rows from south to north. Returns its
/// length in bytes.
///
/// # Errors
/// The shape is out of range, or does not fit the number of nodes or the size of `out`.
pub fn write(shape: &FieldShape, nodes_dm: &[i16], out: &mut [u8]) -> Result<usize, FileError> {
    shape.check()?;
    let length = shape.encoded_len();
    if nodes_dm.len() != shape.node_count() || out.len() < length {
        return Err(FileError::Length);
    }
    let words = [VERSION, shape.columns, shape.rows, 0];
    let numbers = [shape.south_west.x, shape.south_west.y, shape.cell_m];
    let head = MAGIC.into_iter().chain(words.into_iter().flat_map(u16::to_le_bytes));
    let head = head.chain(numbers.into_iter().flat_map(f32::to_le_bytes));
    let body = nodes_dm.iter().flat_map(|node| node.to_le_bytes());
    for (to, byte) in out.iter_mut().zip(head.chain(body)) {
        *to = byte;
    }
    let crc = CRC32.checksum(&out[..length - CRC_LEN]);
    out[length - CRC_LEN..length].copy_from_slice(&crc.to_le_bytes());
    Ok(length)
}

#[cfg(test)]
mod tests;
