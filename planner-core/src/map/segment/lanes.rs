//! Masks of the cells of a brick by their index (0 to 3, the layer) along one axis.

/// Mask of the cells of a brick whose index along `axis` is a set bit of `layers` (bits 0 to 3).
#[inline(always)]
pub(crate) fn brick_layer_mask(axis: usize, layers: u32) -> u64 {
    const LAYER_MASKS: [[u64; 16]; 3] = all_brick_layer_masks();
    LAYER_MASKS[axis][(layers & 15) as usize]
}

/// The masks of [`brick_layer_mask`] for each axis and each set of layers.
const fn all_brick_layer_masks() -> [[u64; 16]; 3] {
    let mut out = [[0; 16]; 3];
    let mut layers = 0;
    while layers < 16 {
        let mut bit = 0;
        while bit < 64 {
            let layer = [bit % 4, bit / 4 % 4, bit / 16];
            let mut axis = 0;
            while axis < 3 {
                if layers >> layer[axis] & 1 == 1 {
                    out[axis][layers] |= 1 << bit;
                }
                axis += 1;
            }
            bit += 1;
        }
        layers += 1;
    }
    out
}
