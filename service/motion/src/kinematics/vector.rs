//! Vectors of three components, and rotations about a unit vector.

/// A vector or a point.
pub type Vec3 = [f64; 3];

/// a + b.
#[must_use]
pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a − b.
#[must_use]
pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// s·a.
#[must_use]
pub fn scale(a: Vec3, s: f64) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// a + s·b.
#[must_use]
pub fn add_scaled(a: Vec3, b: Vec3, s: f64) -> Vec3 {
    [a[0] + b[0] * s, a[1] + b[1] * s, a[2] + b[2] * s]
}

/// a·b.
#[must_use]
pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a×b.
#[must_use]
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// |a|.
#[must_use]
pub fn norm(a: Vec3) -> f64 {
    libm::sqrt(dot(a, a))
}

/// The unit vector of `a`; nothing for a vector of length zero, or one whose length is not a finite number.
#[must_use]
pub fn unit(a: Vec3) -> Option<Vec3> {
    // The largest component first, so that neither tiny nor huge vectors lose their direction to under- or overflow.
    let largest = a.iter().fold(0.0_f64, |largest, component| largest.max(component.abs()));
    if !(largest > 0.0 && a.iter().all(|component| component.is_finite())) {
        return None;
    }
    let reduced = a.map(|component| component / largest);
    Some(scale(reduced, 1.0 / norm(reduced)))
}

/// Angle between two vectors, rad, precise for small angles and near π alike.
#[must_use]
pub fn angle(a: Vec3, b: Vec3) -> f64 {
    libm::atan2(norm(cross(a, b)), dot(a, b))
}

/// Turns `v` about the unit vector `axis` by the angle with this sine and cosine (Rodrigues).
#[must_use]
pub fn rotate(axis: Vec3, (sine, cosine): (f64, f64), v: Vec3) -> Vec3 {
    let along = dot(axis, v) * (1.0 - cosine);
    let across = cross(axis, v);
    [
        v[0] * cosine + across[0] * sine + axis[0] * along,
        v[1] * cosine + across[1] * sine + axis[1] * along,
        v[2] * cosine + across[2] * sine + axis[2] * along,
    ]
}

/// Angle by which `from` must turn about the unit vector `axis` to point where `to` does, seen along the axis, rad in
/// (−π, π]; 0 where one of them is parallel to the axis.
#[must_use]
pub fn angle_about(axis: Vec3, from: Vec3, to: Vec3) -> f64 {
    let from = add_scaled(from, axis, -dot(axis, from));
    let to = add_scaled(to, axis, -dot(axis, to));
    libm::atan2(dot(axis, cross(from, to)), dot(from, to))
}
