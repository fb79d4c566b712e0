//! Masks of the cells of a brick by their index (0 to 3, the lane) along one axis.

/// Mask of the cells of a brick whose index along `axis` is a set bit of `lanes` (bits 0 to 3).
#[inline(always)]
pub(crate) fn lane_mask(axis: usize, lanes: u32) -> u64 {
    const LAYER_MASKS: [[u64; 16]; 3] = lane_masks();
    LAYER_MASKS[axis][(lanes & 15) as usize]
}

const fn lane_masks() -> [[u64; 16]; 3] {
    let mut out = [[0; 16]; 3];
    let mut lanes = 0;
    while lanes < 16 {
        let mut bit = 0;
        while bit < 64 {
            let lane = [bit % 4, bit / 4 % 4, bit / 16];
            let mut axis = 0;
            while axis < 3 {
                if lanes >> lane[axis] & 1 == 1 {
                    out[axis][lanes] |= 1 << bit;
                }
                axis += 1;
            }
            bit += 1;
        }
        lanes += 1;
    }
    out
}
