use super::*;

fn area(polygon: &Polygon) -> f64 {
    (1..polygon.len() - 1)
        .map(|i| twice_signed_area(&polygon[0], &polygon[i], &polygon[i + 1]) / 2.0)
        .sum()
}

#[test]
fn a_polygon_with_fewer_corners_holds_the_hull_and_is_little_larger() {
    let circle: Polygon = (0..400)
        .map(|i| {
            let angle = f64::from(i) * 0.7;
            let far = 10.0 * f64::from(i % 7 + 1) / 7.0;
            [3.0 + far * angle.cos(), far * angle.sin()]
        })
        .collect();
    let hull = convex_hull(circle.clone());
    let few = simplified_outward(hull.clone(), 8);
    assert!(hull.len() > 20 && few.len() == 8, "{} {}", hull.len(), few.len());
    let near = |polygon: &Polygon| offset_outward(polygon, 1e-9);
    assert!(circle.iter().all(|point| contains(&near(&hull), point)));
    assert!(hull.iter().all(|point| contains(&near(&few), point)));
    assert!(area(&few) < 1.1 * area(&hull), "{} {}", area(&few), area(&hull));
}

#[test]
fn a_box_moved_out_is_a_box() {
    let square = bounding_box(&vec![[1.0, 2.0], [4.0, 0.0]]);
    assert_eq!(offset_outward(&square, 0.5), bounding_box(&vec![[0.5, -0.5], [4.5, 2.5]]));
    assert!((area(&square) - 6.0).abs() < 1e-12);
}
