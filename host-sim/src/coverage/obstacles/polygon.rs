//! Convex polygons with corners in counterclockwise order.

/// The corners of a polygon, east and north, metres.
pub(super) type Polygon = Vec<[f64; 2]>;

/// The vector from `b` to `a`.
fn minus(a: &[f64; 2], b: &[f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Cross product, positive if `b` points to the left of `a`.
fn cross(a: &[f64; 2], b: &[f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// Twice the area of the triangle `a b c`, positive if its corners are in counterclockwise order.
fn twice_signed_area(a: &[f64; 2], b: &[f64; 2], c: &[f64; 2]) -> f64 {
    cross(&minus(b, a), &minus(c, a))
}

/// The convex hull of at least three points that are not on one line (Andrew's monotone chain).
pub(super) fn convex_hull(mut points: Polygon) -> Polygon {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    let half = |points: &mut dyn Iterator<Item = &[f64; 2]>| {
        let mut chain = Polygon::new();
        for point in points {
            while chain.len() >= 2
                && twice_signed_area(&chain[chain.len() - 2], &chain[chain.len() - 1], point) <= 0.0
            {
                chain.pop();
            }
            chain.push(*point);
        }
        chain.pop();
        chain
    };
    let lower = half(&mut points.iter());
    let upper = half(&mut points.iter().rev());
    [lower, upper].concat()
}

/// The box along the axes around some points; its third corner is opposite to the first.
pub(super) fn bounding_box(points: &Polygon) -> Polygon {
    let along = |axis: usize| points.iter().map(move |point| point[axis]);
    let low = [0, 1].map(|axis| along(axis).fold(f64::INFINITY, f64::min));
    let high = [0, 1].map(|axis| along(axis).fold(f64::NEG_INFINITY, f64::max));
    vec![low, [high[0], low[1]], high, [low[0], high[1]]]
}

/// A polygon of at most `most` corners around a convex one; `most` is at least 5. As long as the
/// polygon has more, the edge whose removal adds the least area is dropped, and the two
/// neighbouring edges are extended until they meet.
pub(super) fn simplified_outward(mut polygon: Polygon, most: usize) -> Polygon {
    while polygon.len() > most {
        let n = polygon.len();
        let added = |i: usize| {
            let [before, a, b, after] = [i + n - 1, i, i + 1, i + 2].map(|k| polygon[k % n]);
            let (into, out) = (minus(&a, &before), minus(&after, &b));
            let bend = cross(&into, &out);
            // If the neighbouring edges do not meet when extended, this edge cannot be dropped.
            (bend > 0.0).then(|| {
                let share = cross(&minus(&b, &a), &out) / bend;
                let meet = [a[0] + into[0] * share, a[1] + into[1] * share];
                (twice_signed_area(&a, &meet, &b), i, meet)
            })
        };
        let least = (0..n).filter_map(added).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, i, meet)) = least else { break };
        polygon[i] = meet;
        polygon.remove((i + 1) % n);
    }
    polygon
}

/// A convex polygon with every edge moved out by `by_m`.
pub(super) fn offset_outward(polygon: &Polygon, by_m: f64) -> Polygon {
    let n = polygon.len();
    let outward = |i: usize| {
        let edge = minus(&polygon[(i + 1) % n], &polygon[i % n]);
        let length = edge[0].hypot(edge[1]);
        [edge[1] / length, -edge[0] / length]
    };
    let corner = |i: usize| {
        let (into, out) = (outward(i + n - 1), outward(i));
        let by = by_m / (1.0 + into[0] * out[0] + into[1] * out[1]);
        [0, 1].map(|axis| polygon[i][axis] + by * (into[axis] + out[axis]))
    };
    (0..n).map(corner).collect()
}

/// Whether a convex polygon contains a point.
pub(super) fn contains(polygon: &Polygon, point: &[f64; 2]) -> bool {
    let ends = polygon.iter().zip(polygon.iter().cycle().skip(1));
    ends.into_iter().all(|(a, b)| twice_signed_area(a, b, point) >= 0.0)
}

#[cfg(test)]
mod tests;
