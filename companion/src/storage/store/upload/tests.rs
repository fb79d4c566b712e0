extern crate std;

use planner_core::coverage::Flat;
use planner_core::map::field::{self, FieldShape};

use super::super::flash::MAX_PROGRAM_LEN;
use super::super::tests::upload;
use super::*;
use crate::testing::fake_flash::*;

/// A file whose last block is full leaves nothing in the window once that block is in flash.
#[test]
fn a_file_that_fills_its_last_block_is_stored() {
    let (mut full, south_west) = (0, Flat::zeros());
    for columns in 2..700 {
        let shape = FieldShape { south_west, cell_m: 5.0, columns, rows: 2 };
        if shape.encoded_len() % MAX_PROGRAM_LEN > 4 {
            continue;
        }
        full += usize::from(shape.encoded_len().is_multiple_of(MAX_PROGRAM_LEN));
        let mut file = std::vec![0; shape.encoded_len()];
        field::write(&shape, &std::vec![70; shape.node_count()], &mut file).unwrap();
        let mut flash = Flash::new(u64::from(columns));
        let mut store = started(&mut flash);
        let result = upload(&mut store, &mut flash, File::Field, &file, 239);
        assert_eq!(result.unwrap(), Ok(()), "{} bytes", file.len());
    }
    assert!(full > 5, "{full} files fill their last block");
}
