//! Convex rings in a plane: hulls, areas and intersections.

/// Twice the area of the triangle of three points, positive when it is counterclockwise.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The convex hull, counterclockwise (Andrew's monotone chain).
#[must_use]
pub fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut ring: Vec<[f64; 2]> = Vec::new();
    let back = points.clone().into_iter().rev();
    for points in [points, back.collect()] {
        let start = ring.len();
        for point in points {
            while ring.len() >= start + 2
                && turn(ring[ring.len() - 2], ring[ring.len() - 1], point) <= 0.0
            {
                ring.pop();
            }
            ring.push(point);
        }
        ring.pop();
    }
    ring
}

/// The area of a ring, positive when it is counterclockwise.
#[must_use]
pub fn area(ring: &[[f64; 2]]) -> f64 {
    let triangles = (2..ring.len()).map(|next| turn(ring[0], ring[next - 1], ring[next]));
    0.5 * triangles.sum::<f64>()
}

/// The intersection of a ring with a convex counterclockwise one (Sutherland and Hodgman).
#[must_use]
pub fn clipped(ring: Vec<[f64; 2]>, by: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut ring = ring;
    for (edge, from) in by.iter().enumerate() {
        let to = by[(edge + 1) % by.len()];
        let mut inside = Vec::with_capacity(ring.len() + 2);
        for (number, point) in ring.iter().enumerate() {
            let next = ring[(number + 1) % ring.len()];
            let (here, there) = (turn(*from, to, *point), turn(*from, to, next));
            if here >= 0.0 {
                inside.push(*point);
            }
            if here * there < 0.0 {
                let share = here / (here - there);
                inside.push([0, 1].map(|axis| point[axis] + share * (next[axis] - point[axis])));
            }
        }
        ring = inside;
    }
    ring
}
