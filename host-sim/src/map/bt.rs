//! Reads and writes OctoMap's binary octree file, `.bt`: cells are occupied, free or unknown,
//! without probabilities.
//!
//! The file has a text header (`# Octomap OcTree binary file`, then `id`, `size`, `res` and `data`,
//! one a line), then the inner nodes depth first. Each is a little-endian 16-bit word with two bits
//! for each of its eight children, from the lowest bits up: 0 unknown, 1 free leaf, 2 occupied
//! leaf, 3 inner node, whose own word follows. Source: OctoMap 1.9,
//! `OccupancyOcTreeBase::readBinaryNode`. Each inner node takes two bytes of the file and eight in
//! memory, so memory is bounded by four times the file's length, whatever the header claims.

use std::fmt::Write as _;
use std::path::Path;

use super::error::MapError;
use super::octree::{INNER, InnerNode, Octree, TREE_DEPTH};
use crate::files;

/// Accepted values of the header's `id`; the colours of a ColorOcTree are ignored.
const ACCEPTED_IDS: [&str; 2] = ["OcTree", "ColorOcTree"];
/// How the first line of a file begins.
const MAGIC: &str = "# Octomap OcTree binary file";
/// Longest file that is read, bytes: in memory it takes four times as much. The largest public
/// scans are a tenth of it.
const MAX_BYTES: u64 = 1 << 26;
/// Longest header line, bytes; OctoMap's own comment line has 75.
const MAX_HEADER_LINE: usize = 1024;

/// Reads a `.bt` file.
pub fn read(path: &Path) -> Result<Octree, MapError> {
    let bytes =
        files::read(path, MAX_BYTES).map_err(|source| MapError::from_io("read", path, source))?;
    parse(&bytes, path)
}

/// Parses the bytes of a `.bt` file; `path` only names it in errors.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Octree, MapError> {
    let mut reader = Reader { bytes, at: 0, path, inner: Vec::new(), nodes_read: 0 };
    let header = reader.header()?;
    if header.nodes > 0 {
        reader.nodes_read = 1;
        let root = reader.node(0)?;
        reader.inner.push(root);
    }
    if reader.nodes_read != header.nodes {
        let expected = format!("as many nodes as the data holds, {}", reader.nodes_read);
        return Err(reader.error_at(header.nodes_offset, expected, header.nodes.to_string()));
    }
    if reader.at < bytes.len() {
        let found = format!("{} more bytes", bytes.len() - reader.at);
        return Err(reader.error_at(reader.at, "the end of the file", found));
    }
    Ok(Octree::from_parts(header.resolution_m, reader.inner))
}

/// The values of a header.
struct BtHeader {
    /// Value of `size`: the number of all nodes, leaves included.
    nodes: u64,
    /// Offset of that number in the file, bytes.
    nodes_offset: usize,
    /// Edge of the smallest cells, metres.
    resolution_m: f64,
}

/// Reads the bytes of a file from front to back.
struct Reader<'a> {
    /// The whole file.
    bytes: &'a [u8],
    /// Offset of the next byte to read.
    at: usize,
    /// Path of the file, for errors.
    path: &'a Path,
    /// Inner nodes read so far; the inner children of one node follow each other.
    inner: Vec<InnerNode>,
    /// Number of nodes read so far, leaves included.
    nodes_read: u64,
}

impl<'a> Reader<'a> {
    /// The error that at `offset` other bytes are found than expected.
    fn error_at(
        &self,
        offset: usize,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> MapError {
        MapError::Malformed {
            file: self.path.into(),
            offset: offset as u64,
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// Reads the next header line, without its end of line; also returns the offset at which it
    /// begins.
    fn header_line(&mut self, expected: &str) -> Result<(&'a str, usize), MapError> {
        let begin = self.at;
        let rest = &self.bytes[begin..self.bytes.len().min(begin + MAX_HEADER_LINE)];
        let Some(length) = rest.iter().position(|&b| b == b'\n') else {
            let found =
                if begin == self.bytes.len() { "the end of the file" } else { "no end of line" };
            return Err(self.error_at(begin, expected, found));
        };
        self.at = begin + length + 1;
        match std::str::from_utf8(&rest[..length]) {
            Ok(text) => Ok((text.trim_end_matches('\r'), begin)),
            Err(_) => Err(self.error_at(begin, expected, "bytes that are no text")),
        }
    }

    /// Reads the header, its last line `data` included.
    fn header(&mut self) -> Result<BtHeader, MapError> {
        let expected = format!("`{MAGIC}`");
        let (first, at) = self.header_line(&expected)?;
        if !first.starts_with(MAGIC) {
            return Err(self.error_at(at, expected, quoted(first)));
        }
        let (mut id, mut nodes, mut resolution_m) = (false, None, None);
        let after_header;
        loop {
            let missing = if !id {
                "`id OcTree`"
            } else if nodes.is_none() {
                "`size N`"
            } else if resolution_m.is_none() {
                "`res METRES`"
            } else {
                "`data`"
            };
            let (line, at) = self.header_line(missing)?;
            let (word, value) = line.split_once(' ').unwrap_or((line, ""));
            let (value_at, value) = (at + word.len() + 1, value.trim());
            match word {
                "" => {}
                _ if line.starts_with('#') => {}
                "id" if ACCEPTED_IDS.contains(&value) => id = true,
                "id" => {
                    return Err(self.error_at(
                        value_at,
                        "the id `OcTree` or `ColorOcTree`",
                        quoted(value),
                    ));
                }
                "size" => match value.parse::<u64>() {
                    Ok(n) => nodes = Some((n, value_at)),
                    Err(_) => {
                        return Err(self.error_at(value_at, "a number of nodes", quoted(value)));
                    }
                },
                "res" => match value.parse::<f64>() {
                    Ok(r) if r.is_finite() && (1e-6..=1e6).contains(&r) => resolution_m = Some(r),
                    _ => {
                        let expected = "a resolution from 0.000001 to 1000000 metres";
                        return Err(self.error_at(value_at, expected, quoted(value)));
                    }
                },
                "data" => {
                    after_header = at;
                    break;
                }
                _ => return Err(self.error_at(at, missing, quoted(line))),
            }
        }
        match (id, nodes, resolution_m) {
            (true, Some((nodes, nodes_offset)), Some(resolution_m)) => {
                Ok(BtHeader { nodes, nodes_offset, resolution_m })
            }
            (false, ..) => Err(self.error_at(after_header, "`id OcTree`", "`data`")),
            (_, None, _) => Err(self.error_at(after_header, "`size N`", "`data`")),
            _ => Err(self.error_at(after_header, "`res METRES`", "`data`")),
        }
    }

    /// Reads the inner node at `depth`, whose word comes next, and its children. Recursion ends at
    /// [`TREE_DEPTH`].
    fn node(&mut self, depth: u32) -> Result<InnerNode, MapError> {
        let begin = self.at;
        let Some(&[low, high]) = self.bytes.get(begin..begin + 2) else {
            let found = format!("the end of the file ({} bytes)", self.bytes.len());
            return Err(self.error_at(
                begin,
                format!("the two bytes of an inner node at depth {depth}"),
                found,
            ));
        };
        self.at += 2;
        let mut node =
            InnerNode { child_codes: u16::from_le_bytes([low, high]), first_inner_child: 0 };
        if node.child_codes == 0 {
            return Err(self.error_at(begin, "an inner node with children", "one without"));
        }
        let mut inner = heapless::Vec::<InnerNode, 8>::new();
        for index in 0..8 {
            let child = node.child_code(index);
            self.nodes_read += u64::from(child != 0);
            if child != INNER {
                continue;
            }
            if depth + 1 == TREE_DEPTH {
                return Err(self.error_at(
                    begin,
                    format!("leaves at depth {TREE_DEPTH}"),
                    "a child that is an inner node",
                ));
            }
            inner.push(self.node(depth + 1)?).expect("a node has eight children");
        }
        node.first_inner_child = self.inner.len() as u32;
        self.inner.extend_from_slice(&inner);
        Ok(node)
    }
}

/// Header text for an error message: at most 40 characters, escaped.
fn quoted(text: &str) -> String {
    format!("`{}`", text.chars().take(40).flat_map(char::escape_default).collect::<String>())
}

/// Encodes a tree as a `.bt` file.
pub fn to_bytes(tree: &Octree) -> Vec<u8> {
    let mut header = String::new();
    let (nodes, res) = (tree.counts().nodes, tree.resolution_m());
    writeln!(header, "{MAGIC}\nid OcTree\nsize {nodes}\nres {res}\ndata")
        .expect("a String takes any text");
    let mut bytes = header.into_bytes();
    if let Some(root) = tree.root() {
        push_node(tree, root, &mut bytes);
    }
    bytes
}

/// Appends the words of an inner node and of all inner nodes below it, depth first.
fn push_node(tree: &Octree, node: InnerNode, bytes: &mut Vec<u8>) {
    bytes.extend_from_slice(&node.child_codes.to_le_bytes());
    for index in (0..8).filter(|&i| node.child_code(i) == INNER) {
        push_node(tree, tree.inner[node.inner_index(index)], bytes);
    }
}

/// Writes a `.bt` file.
pub fn write(tree: &Octree, path: &Path) -> Result<(), MapError> {
    std::fs::write(path, to_bytes(tree)).map_err(|source| MapError::from_io("write", path, source))
}

#[cfg(test)]
mod tests;
