//! Writes a roadmap into the caller's buffer, without other memory: rows are counted, filled and
//! sorted in place.

use super::format::{
    HEADER_LEN, HEIGHT_LEN, LANDMARK_COUNT, LANDMARK_DISTANCES_LEN, MAGIC, MAX_LANDMARK_DISTANCE_M,
    MAX_NODES, NODE_LEN, RoadmapError, RoadmapHeader, VERSION, VERSION_WITHOUT_HEIGHTS, WORD_LEN,
    decode_target, encoded_len, floor_to_millimetres, has_valid_coordinates,
};
use super::view::RoadmapView;
use crate::Point;
use crate::file::{CRC32, FileError};
use crate::roadmap::search::{SearchWorkspace, shortest_path_tree};

/// An undirected edge to write.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Index of one node.
    pub a: u16,
    /// Index of the other node.
    pub b: u16,
    /// Distance from the edge to the nearest obstacle, metres; stored rounded down to a millimetre,
    /// at most [`RoadmapHeader::max_clearance_m`].
    pub clearance_m: f32,
}

/// Writes a roadmap without landmarks and returns its length in bytes. O(nodes + edges · log
/// degree), no memory but `out`.
///
/// The terminals come first in `nodes`: starts, then goals. Neither the order of `edges` nor that
/// of an edge's two ends changes the bytes. After an error the content of `out` is undefined.
pub fn write(
    header: &RoadmapHeader,
    nodes: &[Point],
    edges: &[Edge],
    out: &mut [u8],
) -> Result<usize, RoadmapError> {
    let out = write_graph(header, nodes, edges, 0, out)?;
    Ok(append_crc(out))
}

/// As [`write()`], with the lengths of the shortest paths from each node to [`LANDMARK_COUNT`]
/// landmarks, with which a search in a building settles half as many nodes. The first landmark is
/// node 0, a start if there are any; the second is the node whose shortest path to the first is
/// longest. Costs one more search per landmark.
///
/// `heights_m` are the nodes' heights above the ground, infinite where nothing is below; if the
/// slice is empty, the file has no heights.
pub fn write_with_landmarks<const N: usize>(
    header: &RoadmapHeader,
    nodes: &[Point],
    edges: &[Edge],
    heights_m: &[f32],
    ws: &mut SearchWorkspace<N>,
    out: &mut [u8],
) -> Result<usize, RoadmapError> {
    if !heights_m.is_empty() && heights_m.len() != nodes.len() {
        return Err(RoadmapError::Height(heights_m.len().min(nodes.len()) as u16));
    }
    let columns = LANDMARK_COUNT + usize::from(!heights_m.is_empty());
    let out = write_graph(header, nodes, edges, columns, out)?;
    if nodes.is_empty() {
        return Ok(append_crc(out));
    }
    let body = &mut out[HEADER_LEN..];
    let heights_len = heights_m.len() * HEIGHT_LEN;
    let numbers = nodes.len() * LANDMARK_DISTANCES_LEN + heights_len;
    let (graph, rest) = body.split_at_mut(body.len() - WORD_LEN - numbers);
    let heights = &mut rest[nodes.len() * LANDMARK_DISTANCES_LEN..][..heights_len];
    for (bytes, height_m) in heights.as_chunks_mut::<HEIGHT_LEN>().0.iter_mut().zip(heights_m) {
        *bytes = height_m.to_le_bytes();
    }
    let view = RoadmapView::from_body(*header, 0, graph, [nodes.len(), 2 * edges.len(), 0]);
    let ways = &mut rest.as_chunks_mut::<WORD_LEN>().0[..nodes.len() * LANDMARK_COUNT];
    let mut landmark = 0;
    for column in 0..LANDMARK_COUNT {
        shortest_path_tree(&view, landmark, ws).map_err(|_| RoadmapError::WorkspaceTooSmall)?;
        let mut farthest_m = 0.0;
        for (node, ways) in (0..nodes.len() as u16).zip(ways.chunks_exact_mut(LANDMARK_COUNT)) {
            let reached = Some(ws.distance_m(node)).filter(|way| way.is_finite());
            let way_m = reached.unwrap_or(0.0);
            if way_m > MAX_LANDMARK_DISTANCE_M {
                return Err(RoadmapError::Landmark(node));
            }
            ways[column] = way_m.to_le_bytes();
            if way_m > farthest_m {
                (landmark, farthest_m) = (node, way_m);
            }
        }
    }
    // Where an edge is so short that adding it does not change an f32 sum, [`RoadmapView::parse`]
    // would refuse the file.
    let body = &out[HEADER_LEN..out.len() - WORD_LEN];
    let view =
        RoadmapView::from_body(*header, 0, body, [nodes.len(), 2 * edges.len(), LANDMARK_COUNT]);
    view.check_landmarks()?;
    view.check_heights()?;
    Ok(append_crc(out))
}

/// Writes all but the `columns` of numbers per node and the CRC; returns the bytes of the whole
/// file.
fn write_graph<'a>(
    header: &RoadmapHeader,
    nodes: &[Point],
    edges: &[Edge],
    columns: usize,
    out: &'a mut [u8],
) -> Result<&'a mut [u8], RoadmapError> {
    if nodes.len() > MAX_NODES {
        return Err(RoadmapError::TooManyNodes);
    }
    let needed = encoded_len(nodes.len(), edges.len(), columns).ok_or(FileError::Length)?;
    let out = out.get_mut(..needed).ok_or(RoadmapError::RoadmapFull { needed })?;
    header.check(nodes.len())?;
    check_edges(header, nodes, edges)?;

    let (head, rest) = out.split_at_mut(HEADER_LEN);
    let version = if columns > LANDMARK_COUNT { VERSION } else { VERSION_WITHOUT_HEIGHTS };
    write_header(
        header,
        version,
        [nodes.len(), 2 * edges.len(), columns.min(LANDMARK_COUNT)],
        needed,
        head,
    );
    let (node_bytes, rest) = rest.split_at_mut(nodes.len() * NODE_LEN);
    let scalars = nodes.iter().flat_map(|p| [p.x, p.y, p.z]);
    for (bytes, value) in node_bytes.as_chunks_mut::<4>().0.iter_mut().zip(scalars) {
        *bytes = value.to_le_bytes();
    }
    let (offsets, rest) = rest.as_chunks_mut::<WORD_LEN>().0.split_at_mut(nodes.len() + 1);
    write_rows(header, edges, offsets, &mut rest[..2 * edges.len()])?;
    Ok(out)
}

/// Writes the CRC at the end of the file; returns the file's length.
fn append_crc(out: &mut [u8]) -> usize {
    let (body, crc) = out.split_at_mut(out.len() - WORD_LEN);
    crc.copy_from_slice(&CRC32.checksum(body).to_le_bytes());
    out.len()
}

/// Checks coordinates, and that each edge is one that [`RoadmapView::parse`] would accept;
/// duplicates are found by [`write_rows`].
fn check_edges(
    header: &RoadmapHeader,
    nodes: &[Point],
    edges: &[Edge],
) -> Result<(), RoadmapError> {
    for (i, node) in nodes.iter().enumerate() {
        if !has_valid_coordinates(node) {
            return Err(RoadmapError::Node(i as u16));
        }
    }
    let (least_m, _) = header.clearance_limits_m();
    for (i, edge) in edges.iter().enumerate() {
        let (Some(a), Some(b)) = (nodes.get(usize::from(edge.a)), nodes.get(usize::from(edge.b)))
        else {
            return Err(RoadmapError::EdgeNode(i));
        };
        if edge.a == edge.b {
            return Err(RoadmapError::SelfLoop(i));
        }
        if !(edge.clearance_m >= 0.0 && edge.clearance_m.is_finite()) {
            return Err(RoadmapError::InvalidClearance(i));
        }
        if edge.clearance_m < least_m {
            return Err(RoadmapError::EdgeClearance(edge.a));
        }
        if (b - a).norm_squared() == 0.0 {
            return Err(RoadmapError::ZeroLength(edge.a));
        }
        if !header.is_edge_length_valid(a, b) {
            return Err(RoadmapError::EdgeLength(edge.a));
        }
    }
    Ok(())
}

/// `counts` are the numbers of nodes, half-edges and landmarks; `total` is the file's length.
fn write_header(
    header: &RoadmapHeader,
    version: u16,
    counts: [usize; 3],
    total: usize,
    head: &mut [u8],
) {
    let mut at = 0;
    let mut put = |bytes: &[u8]| {
        head[at..at + bytes.len()].copy_from_slice(bytes);
        at += bytes.len();
    };
    put(&MAGIC);
    put(&version.to_le_bytes());
    put(&(HEADER_LEN as u16).to_le_bytes());
    put(&(total as u32).to_le_bytes());
    for value in [header.origin.lat_deg, header.origin.lon_deg, header.origin.alt_m] {
        put(&value.to_le_bytes());
    }
    for value in
        [header.edge_min_m, header.edge_max_m, header.tested_clearance_m, header.max_clearance_m]
    {
        put(&value.to_le_bytes());
    }
    put(&header.start_count.to_le_bytes());
    put(&header.goal_count.to_le_bytes());
    for count in counts {
        put(&(count as u32).to_le_bytes());
    }
}

/// Fills the compressed sparse rows, each sorted by target, with clearances limited to the header's
/// greatest; an error if an edge occurs twice. `offsets` first counts the degrees, then holds each
/// row's write position, then is shifted by one entry to hold each row's start.
fn write_rows(
    header: &RoadmapHeader,
    edges: &[Edge],
    offsets: &mut [[u8; WORD_LEN]],
    half_edges: &mut [[u8; WORD_LEN]],
) -> Result<(), RoadmapError> {
    let get =
        |offsets: &[[u8; WORD_LEN]], node: u16| u32::from_le_bytes(offsets[usize::from(node)]);
    offsets.fill([0; WORD_LEN]);
    for node in edges.iter().flat_map(|e| [e.a, e.b]) {
        offsets[usize::from(node)] = (get(offsets, node) + 1).to_le_bytes();
    }
    let mut start = 0u32;
    for offset in offsets.iter_mut() {
        let degree = u32::from_le_bytes(*offset);
        *offset = start.to_le_bytes();
        start += degree;
    }
    let limit = floor_to_millimetres(header.max_clearance_m);
    for edge in edges {
        let [c0, c1] = floor_to_millimetres(edge.clearance_m).min(limit).to_le_bytes();
        for (from, to) in [(edge.a, edge.b), (edge.b, edge.a)] {
            let cursor = get(offsets, from);
            let [t0, t1] = to.to_le_bytes();
            half_edges[cursor as usize] = [t0, t1, c0, c1];
            offsets[usize::from(from)] = (cursor + 1).to_le_bytes();
        }
    }
    let last = offsets.len() - 1;
    offsets.copy_within(..last, 1);
    offsets[0] = [0; WORD_LEN];
    for node in 0..last as u16 {
        let row = &mut half_edges[get(offsets, node) as usize..get(offsets, node + 1) as usize];
        row.sort_unstable_by_key(decode_target);
        if let Some(pair) =
            row.windows(2).find(|pair| decode_target(&pair[0]) == decode_target(&pair[1]))
        {
            return Err(RoadmapError::Duplicate(node, decode_target(&pair[0])));
        }
    }
    Ok(())
}
