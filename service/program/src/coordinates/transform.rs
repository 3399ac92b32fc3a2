//! What lies between a programmed position and the work coordinates: mirror image, scaling and rotation, in this order.

use serde::{Deserialize, Serialize};

use crate::{ArcGeometry, Axis, Plane, Position, SplineGeometry};

/// The linear axes that a transformation acts on, as they are in a [`Position`].
const AXES: usize = 3;

/// Two factors are the same up to this share, so that circles stay circles.
const SAME_FACTOR: f64 = 1e-12;

/// `G51`: every coordinate is scaled about a centre.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Scaling {
    /// Centre, mm.
    pub(crate) center: [f64; AXES],
    /// Factors; a negative one mirrors as well.
    pub(crate) factors: [f64; AXES],
}

/// A rotation in a plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Rotation {
    pub(crate) plane: Plane,
    /// Along the axes of the plane, mm, in coordinates that are mirrored and scaled already.
    pub(crate) center: [f64; 2],
    /// Counter-clockwise about the normal of the plane, degrees.
    pub(crate) angle_deg: f64,
    cosine: f64,
    sine: f64,
}

impl Rotation {
    pub(crate) fn new(plane: Plane, center: [f64; 2], angle_deg: f64) -> Self {
        let [cosine, sine] = direction(angle_deg);
        Self { plane, center, angle_deg, cosine, sine }
    }

    /// A vector of the plane turned by the angle, or back.
    pub(crate) fn turn(&self, [first, second]: [f64; 2], back: bool) -> [f64; 2] {
        let sine = if back { -self.sine } else { self.sine };
        [first * self.cosine - second * sine, first * sine + second * self.cosine]
    }

    fn apply(&self, position: &mut Position, back: bool) {
        let (first, second) = self.plane.axes();
        let [along, across] = self.center;
        let arm = [position[first.index()] - along, position[second.index()] - across];
        let [turned_along, turned_across] = self.turn(arm, back);
        position[first.index()] = along + turned_along;
        position[second.index()] = across + turned_across;
    }
}

/// Mirror image, scaling and rotation, applied in this order to a programmed position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Transform {
    /// `G51.1`: the coordinate of the mirror along each axis, mm.
    pub(crate) mirror: [Option<f64>; AXES],
    pub(crate) scaling: Option<Scaling>,
    pub(crate) rotation: Option<Rotation>,
}

impl Transform {
    pub(crate) fn is_identity(&self) -> bool {
        self.mirror == [None; AXES] && self.scaling.is_none() && self.rotation.is_none()
    }

    /// Work coordinates of a programmed position.
    pub(crate) fn apply(&self, position: &Position) -> Position {
        let mut placed = self.before_rotation(position);
        if let Some(rotation) = &self.rotation {
            rotation.apply(&mut placed, false);
        }
        placed
    }

    /// The position mirrored and scaled, but not rotated.
    pub(crate) fn before_rotation(&self, position: &Position) -> Position {
        let mut placed = *position;
        for (value, mirror) in placed.iter_mut().zip(&self.mirror) {
            if let Some(mirror) = mirror {
                *value = 2.0 * mirror - *value;
            }
        }
        if let Some(Scaling { center, factors }) = &self.scaling {
            for axis in 0..AXES {
                placed[axis] = center[axis] + factors[axis] * (placed[axis] - center[axis]);
            }
        }
        placed
    }

    /// The programmed position of work coordinates.
    pub(crate) fn invert(&self, placed: &Position) -> Position {
        let mut position = *placed;
        if let Some(rotation) = &self.rotation {
            rotation.apply(&mut position, true);
        }
        if let Some(Scaling { center, factors }) = &self.scaling {
            for axis in 0..AXES {
                position[axis] = center[axis] + (position[axis] - center[axis]) / factors[axis];
            }
        }
        for (value, mirror) in position.iter_mut().zip(&self.mirror) {
            if let Some(mirror) = mirror {
                *value = 2.0 * mirror - *value;
            }
        }
        position
    }

    /// What an axis is stretched by, negative where it is mirrored.
    pub(crate) fn factor(&self, axis: Axis) -> f64 {
        let Some(mirror) = self.mirror.get(axis.index()) else { return 1.0 };
        let factor = self.scaling.map_or(1.0, |scaling| scaling.factors[axis.index()]);
        if mirror.is_some() { -factor } else { factor }
    }

    /// Whether the senses of circles and sides are swapped in a plane.
    pub(crate) fn swaps_sides(&self, plane: Plane) -> bool {
        let (first, second) = plane.axes();
        self.factor(first) * self.factor(second) < 0.0
    }

    /// Whether circles of a plane stay circles of that plane.
    pub(crate) fn keeps_circles(&self, plane: Plane) -> bool {
        let (first, second) = plane.axes();
        let [along, across] = [self.factor(first).abs(), self.factor(second).abs()];
        (along - across).abs() <= SAME_FACTOR * along.max(across) && self.keeps_plane(plane)
    }

    /// Whether curves of a plane stay in that plane.
    pub(crate) fn keeps_plane(&self, plane: Plane) -> bool {
        self.rotation.is_none_or(|rotation| rotation.plane == plane)
    }

    /// The circle in work coordinates; [`Transform::keeps_circles`] must hold for its plane.
    pub(crate) fn arc(&self, arc: &ArcGeometry) -> ArcGeometry {
        let swaps = self.swaps_sides(arc.plane);
        ArcGeometry {
            plane: arc.plane,
            center: self.point(arc.plane, arc.center),
            clockwise: arc.clockwise != swaps,
            sweep_rad: if swaps { -arc.sweep_rad } else { arc.sweep_rad },
        }
    }

    /// The spline in work coordinates; [`Transform::keeps_plane`] must hold for its plane.
    pub(crate) fn spline(&self, spline: &mut SplineGeometry) {
        for point in &mut spline.points {
            *point = self.point(spline.plane, *point);
        }
    }

    fn point(&self, plane: Plane, point: [f64; 2]) -> [f64; 2] {
        let (first, second) = plane.axes();
        let mut position = Position::default();
        position[first.index()] = point[0];
        position[second.index()] = point[1];
        let placed = self.apply(&position);
        [placed[first.index()], placed[second.index()]]
    }
}

/// Cosine and sine of an angle, degrees; exact at right angles.
pub(crate) fn direction(angle_deg: f64) -> [f64; 2] {
    let turned = angle_deg.rem_euclid(360.0);
    match turned {
        0.0 => [1.0, 0.0],
        90.0 => [0.0, 1.0],
        180.0 => [-1.0, 0.0],
        270.0 => [0.0, -1.0],
        _ => {
            let (sine, cosine) = libm::sincos(turned.to_radians());
            [cosine, sine]
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn transforms() -> impl Strategy<Value = Transform> {
        let coordinate = -500.0..500.0_f64;
        let mirror = proptest::array::uniform3(proptest::option::of(coordinate.clone()));
        let factor = prop_oneof![0.1..10.0_f64, -10.0..-0.1_f64];
        let scaling = proptest::option::of((proptest::array::uniform3(coordinate.clone()), factor));
        let rotation = proptest::option::of((proptest::array::uniform2(coordinate), -720.0..720.0_f64));
        (mirror, scaling, rotation).prop_map(|(mirror, scaling, rotation)| Transform {
            mirror,
            scaling: scaling.map(|(center, factor)| Scaling { center, factors: [factor, -factor, factor] }),
            rotation: rotation.map(|(center, angle_deg)| Rotation::new(Plane::Xy, center, angle_deg)),
        })
    }

    proptest! {
        #[test]
        fn the_inverse_leads_back(transform in transforms(), at in proptest::array::uniform9(-1e3..1e3_f64)) {
            let back = transform.invert(&transform.apply(&at));
            for (value, back) in at.iter().zip(back) {
                prop_assert!((value - back).abs() < 1e-7, "{value} {back}");
            }
        }

        #[test]
        fn circles_stay_circles(
            transform in transforms(), center in proptest::array::uniform2(-1e3..1e3_f64),
            radius in 0.1..500.0_f64, from in 0.0..360.0_f64, sweep in -720.0..720.0_f64,
        ) {
            let arc = ArcGeometry { plane: Plane::Xy, center, clockwise: sweep < 0.0, sweep_rad: sweep.to_radians() };
            prop_assert!(transform.keeps_circles(Plane::Xy));
            let placed = transform.arc(&arc);
            let on = |arc: &ArcGeometry, from: f64, radius: f64, share: f64| {
                let [cosine, sine] = direction(from + (arc.sweep_rad * share).to_degrees());
                [arc.center[0] + radius * cosine, arc.center[1] + radius * sine]
            };
            // Every point of the programmed circle is, placed, the point of the placed circle at the same share.
            let start = transform.point(Plane::Xy, on(&arc, from, radius, 0.0));
            let arm = [start[0] - placed.center[0], start[1] - placed.center[1]];
            let placed_radius = arm[0].hypot(arm[1]);
            let placed_from = arm[1].atan2(arm[0]).to_degrees();
            for share in [0.0, 0.25, 0.5, 1.0] {
                let [x, y] = transform.point(Plane::Xy, on(&arc, from, radius, share));
                let [placed_x, placed_y] = on(&placed, placed_from, placed_radius, share);
                prop_assert!((x - placed_x).abs() < 1e-6 && (y - placed_y).abs() < 1e-6, "{x} {placed_x} {y} {placed_y}");
            }
        }
    }

    #[test]
    fn mirror_comes_before_scaling_and_scaling_before_rotation() {
        let transform = Transform {
            mirror: [Some(10.0), None, None],
            scaling: Some(Scaling { center: [0.0; 3], factors: [2.0, 2.0, 1.0] }),
            rotation: Some(Rotation::new(Plane::Xy, [0.0; 2], 90.0)),
        };
        // (15, 1) is mirrored to (5, 1), scaled to (10, 2) and rotated to (-2, 10).
        let at = [15.0, 1.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(transform.apply(&at)[..3], [-2.0, 10.0, 3.0]);
        assert!(transform.swaps_sides(Plane::Xy) && !transform.keeps_circles(Plane::Zx));
    }
}
