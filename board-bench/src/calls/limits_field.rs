//! Calls of the height field, and of paths that follow it, with extreme and invalid arguments.

use planner_core::Point;
use planner_core::coverage::Flat;
use planner_core::map::field::follow::TerrainFollowing;
use planner_core::map::field::{self, FieldShape, FieldView, MAX_NODES};

use super::limits_results::{CallListener, EXTREME_NUMBERS, Results};

const COLUMNS: u16 = 3;
const ROWS: u16 = 2;
const NODE_HEIGHTS: [i16; 6] = [0, i16::MAX, i16::MIN, -1, 100, 7];
const FILE_BYTES: usize = 64;

/// East coordinates of the paths' ends, metres.
const END_COORDINATES: [f32; 3] = [0.0, 7.5, -1.0];
/// East coordinates so far away that a path to them has tens of thousands of samples: to save time
/// each is tried with one slope only.
const FAR_COORDINATES: [f32; 3] = [-1e19, f32::INFINITY, f32::NAN];

pub(super) fn call_fields(to: &mut Results<'_, impl CallListener>) {
    let good =
        FieldShape { south_west: Flat::new(-1.0, 2.0), cell_m: 5.0, columns: COLUMNS, rows: ROWS };
    let mut file = [0; FILE_BYTES];
    for hard in EXTREME_NUMBERS {
        for shape in [
            FieldShape { cell_m: hard, ..good },
            FieldShape { south_west: Flat::new(hard, 0.0), ..good },
        ] {
            let written =
                to.call("field::write", || field::write(&shape, &NODE_HEIGHTS, &mut file));
            to.add_count(usize::from(written.is_ok()));
        }
    }
    for (columns, rows) in [(0, 0), (1, 2), (u16::MAX, u16::MAX), (2, 2), (3, 3)] {
        let shape = FieldShape { columns, rows, ..good };
        let nodes = to.call("field::FieldShape::node_count", || shape.node_count());
        let length = to.call("field::FieldShape::encoded_len", || shape.encoded_len());
        assert!(length > 2 * nodes);
        let written = to.call("field::write", || field::write(&shape, &NODE_HEIGHTS, &mut file));
        assert!(written.is_err(), "{columns} by {rows}, at most {MAX_NODES}");
    }
    let length =
        to.call("field::write", || field::write(&good, &NODE_HEIGHTS, &mut file)).expect("a field");
    for bytes in [&file, &[0; FILE_BYTES]] {
        let head = bytes.first_chunk().expect("it is longer");
        let declared = to.call("field::declared_len", || field::declared_len(head));
        assert_eq!(declared.is_ok_and(|declared| declared == length), bytes[0] != 0);
    }
    for cut in 0..length {
        let parsed = to.call("field::FieldView::parse", || FieldView::parse(&file[..cut]));
        assert!(parsed.is_err());
    }
    let field =
        to.call("field::FieldView::parse", || FieldView::parse(&file[..length])).expect("a field");
    assert_eq!(to.call("field::FieldView::shape", || *field.shape()), good);
    let crc = to.call("field::FieldView::crc", || field.crc());
    to.add_count(crc as usize);
    let highest_m = to.call("field::FieldView::highest_m", || field.highest_m());
    to.add(highest_m);
    for x in EXTREME_NUMBERS {
        for y in EXTREME_NUMBERS {
            let height_m =
                to.call("field::FieldView::height_at", || field.height_at(&Flat::new(x, y)));
            to.add(height_m);
        }
    }
    call_field_paths(to, field);
}

fn call_field_paths(to: &mut Results<'_, impl CallListener>, field: FieldView<'_>) {
    for (i, hard) in EXTREME_NUMBERS.into_iter().enumerate() {
        for end in END_COORDINATES.into_iter().chain(FAR_COORDINATES.get(i).copied()) {
            let following =
                TerrainFollowing { field, min_height_m: 30.0, tolerance_m: 3.0, max_slope: hard };
            let (here, there) = (Flat::new(0.0, 3.0), Flat::new(end, 4.0));
            let lowest_m = to
                .call("follow::TerrainFollowing::min_path_z_m", || following.min_path_z_m(&there));
            let top_m =
                to.call("follow::TerrainFollowing::max_path_z_m", || following.max_path_z_m());
            let begin = to.call("follow::TerrainFollowing::start_point", || {
                following.start_point(&here, &there)
            });
            let mut corners = 0;
            let counted = |_: Point| -> Result<(), ()> {
                corners += 1;
                Ok(())
            };
            let ended = to.call("follow::TerrainFollowing::corners_to", || {
                following.corners_to(&begin, &there, counted)
            });
            assert!(ended.is_ok());
            [lowest_m, top_m].iter().for_each(|answer| to.add(*answer));
            to.add_point(&begin);
            to.add_count(corners);
        }
    }
}
