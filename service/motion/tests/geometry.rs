//! Geometry by arc length against analytic positions, and the bounds that planning relies on.

use std::f64::consts::TAU;

use feedwave_motion::Element;
use feedwave_program::{ArcGeometry, Axis, Feed, Move, MoveKind, PathControl, Plane, Position, SourceSpan, Spindle};
use proptest::prelude::*;

fn moved(start: Position, end: Position, arc: Option<ArcGeometry>) -> Move {
    Move {
        kind: MoveKind::Cutting,
        start,
        end,
        work_offset: [0.0; 9],
        arc,
        feed: Feed::PerMinute(1_000.0),
        spindle: Spindle::STOPPED,
        tool: 0,
        spline: None,
        path_control: PathControl::default(),
        cycle: None,
        leads_xyz: false,
    }
}

fn element(start: Position, end: Position, arc: Option<ArcGeometry>) -> Element {
    Element::from_move(&moved(start, end, arc), SourceSpan::default()).expect("it moves")
}

fn position(x: f64, y: f64, z: f64) -> Position {
    [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

/// A helix in the XY plane and its analytic position at a share of its sweep.
#[derive(Clone, Debug)]
struct Helix {
    center: [f64; 2],
    radius: f64,
    start_angle: f64,
    sweep: f64,
    rise: f64,
}

impl Helix {
    fn at(&self, share: f64) -> [f64; 3] {
        let angle = self.start_angle + self.sweep * share;
        [self.center[0] + self.radius * angle.cos(), self.center[1] + self.radius * angle.sin(), self.rise * share]
    }

    fn element(&self) -> Element {
        let [x0, y0, z0] = self.at(0.0);
        let [x1, y1, z1] = self.at(1.0);
        let arc =
            ArcGeometry { plane: Plane::Xy, center: self.center, clockwise: self.sweep < 0.0, sweep_rad: self.sweep };
        element(position(x0, y0, z0), position(x1, y1, z1), Some(arc))
    }

    fn length(&self) -> f64 {
        ((self.radius * self.sweep).powi(2) + self.rise.powi(2)).sqrt()
    }
}

fn helices() -> impl Strategy<Value = Helix> {
    let sweep = prop_oneof![0.001..3.0 * TAU, -3.0 * TAU..-0.001];
    (-1_000.0..1_000.0_f64, -1_000.0..1_000.0_f64, 0.01..500.0_f64, 0.0..TAU, sweep, -100.0..100.0_f64)
        .prop_map(|(x, y, radius, start_angle, sweep, rise)| Helix { center: [x, y], radius, start_angle, sweep, rise })
}

proptest! {
    #[test]
    fn helix_positions_are_analytic_to_a_picometre_or_so(helix in helices(), share in 0.0..1.0_f64) {
        let element = helix.element();
        prop_assert!((element.length - helix.length()).abs() <= 1e-9 * helix.length().max(1.0));
        let found = element.position(share * element.length);
        for (found, wanted) in found.iter().zip(helix.at(share)) {
            prop_assert!((found - wanted).abs() <= 1e-9, "{found} for {wanted}");
        }
    }

    #[test]
    fn columns_equal_single_positions_bit_for_bit_and_ends_are_exact(helix in helices(), shares in prop::collection::vec(-0.1..1.1_f64, 1..40)) {
        let element = helix.element();
        let s: Vec<f64> = shares.iter().map(|share| share * element.length).collect();
        for axis in Axis::ALL {
            let mut column = vec![0.0; s.len()];
            element.fill_axis(axis, &s, &mut column);
            for (value, &s) in column.iter().zip(&s) {
                prop_assert_eq!(value.to_bits(), element.position(s)[axis.index()].to_bits());
            }
        }
        prop_assert_eq!(element.position(element.length), element.end);
        prop_assert_eq!(element.position(element.length * 1.5), element.end);
        prop_assert_eq!(element.position(0.0), element.start);
        prop_assert_eq!(element.position(-1.0), element.start);
    }

    #[test]
    fn the_parameter_is_arc_length_and_the_tangent_its_derivative(helix in helices(), share in 0.01..0.99_f64) {
        let element = helix.element();
        let step = element.length * 1e-4;
        let s = share * element.length;
        let (before, after) = (element.position(s - step), element.position(s + step));
        let tangent = element.tangent(s);
        let mut speed_squared = 0.0;
        // A chord of angle α differs from its arc by the factor 1 − α²/6; here α ≤ 6π·1e-4.
        let allowed = 1e-5 + 1e-9 / step;
        for axis in 0..3 {
            let slope = (after[axis] - before[axis]) / (2.0 * step);
            prop_assert!((slope - tangent[axis]).abs() <= allowed, "{slope} for {}", tangent[axis]);
            speed_squared += tangent[axis] * tangent[axis];
        }
        prop_assert!((speed_squared - 1.0).abs() <= 1e-9);
    }

    #[test]
    fn bounds_hold_everywhere_and_are_attained(helix in helices()) {
        let element = helix.element();
        let (low, high) = element.extent();
        let bound = element.largest_tangent();
        let mut found_low = [f64::INFINITY; 3];
        let mut found_high = [f64::NEG_INFINITY; 3];
        let mut found_tangent = [0.0_f64; 3];
        const SAMPLES: u32 = 4_000;
        for k in 0..=SAMPLES {
            let s = element.length * f64::from(k) / f64::from(SAMPLES);
            let (position, tangent) = (element.position(s), element.tangent(s));
            for axis in 0..3 {
                found_low[axis] = found_low[axis].min(position[axis]);
                found_high[axis] = found_high[axis].max(position[axis]);
                found_tangent[axis] = found_tangent[axis].max(tangent[axis].abs());
            }
        }
        // Between samples the angle changes by at most 6π/4000: the extremes are met to α²/8 of the radius.
        let missed = (3.0 * TAU / f64::from(SAMPLES)).powi(2) / 8.0;
        for axis in 0..3 {
            prop_assert!(found_low[axis] >= low[axis] - 1e-9 && found_high[axis] <= high[axis] + 1e-9);
            prop_assert!(found_low[axis] - low[axis] <= missed * helix.radius + 1e-9);
            prop_assert!(high[axis] - found_high[axis] <= missed * helix.radius + 1e-9);
            prop_assert!(found_tangent[axis] <= bound[axis] * (1.0 + 1e-9) + 1e-12);
            prop_assert!(bound[axis] - found_tangent[axis] <= missed + 1e-9, "bound {} of {}", bound[axis], found_tangent[axis]);
        }
        let curvature = helix.radius / (helix.radius.powi(2) + (helix.rise / helix.sweep).powi(2));
        prop_assert!((element.curvature() - curvature).abs() <= 1e-9 * curvature);
    }

    #[test]
    fn an_arc_with_unequal_radii_is_continuous_and_exact_at_both_ends(
        radius in 0.5..50.0_f64, error in -0.005..0.005_f64, sweep in 0.1..TAU, share in 0.0..1.0_f64,
    ) {
        let end_radius = radius + error;
        let arc = ArcGeometry { plane: Plane::Xy, center: [0.0, 0.0], clockwise: false, sweep_rad: sweep };
        let start = position(radius, 0.0, 0.0);
        let end = position(end_radius * sweep.cos(), end_radius * sweep.sin(), 0.0);
        let element = element(start, end, Some(arc));
        prop_assert_eq!(element.position(element.length), end);
        let near_end = element.position(element.length * (1.0 - 1e-12));
        prop_assert!((near_end[0] - end[0]).abs() < 1e-9 && (near_end[1] - end[1]).abs() < 1e-9);
        let middle = element.position(share * element.length);
        let found = middle[0].hypot(middle[1]);
        // The radius changes evenly with the angle.
        let angle = middle[1].atan2(middle[0]).rem_euclid(TAU);
        prop_assert!((found - (radius + error * angle / sweep)).abs() < 1e-9);
    }

    /// Where elements meet, a step of the length that is travelled would be one of the velocity.
    #[test]
    fn a_spiral_is_travelled_by_its_length(
        radius in 0.5..50.0_f64, error in -0.02..0.02_f64, sweep in 0.1..TAU, share in 0.0..1.0_f64,
        rise in prop_oneof![Just(0.0), -20.0..20.0_f64],
    ) {
        let end_radius = radius + error;
        let arc = ArcGeometry { plane: Plane::Xy, center: [0.0, 0.0], clockwise: false, sweep_rad: sweep };
        let end = position(end_radius * sweep.cos(), end_radius * sweep.sin(), rise);
        let element = element(position(radius, 0.0, 0.0), end, Some(arc));
        let uneven = (error / radius).powi(2) / 4.0;
        for (s, slack) in [(0.0, 1e-12), (element.length, 1e-12), (share * element.length, uneven + 1e-12)] {
            let slope = element.tangent(s).iter().map(|by_length| by_length * by_length).sum::<f64>().sqrt();
            prop_assert!((slope - 1.0).abs() <= slack, "{slope} at {s}");
        }
        let (s, step) = (element.length * (0.1 + 0.8 * share), 1e-4 * element.length);
        let at = |steps: f64| element.derivatives(s + steps * step);
        let (before, here, behind) = (at(-1.0), at(0.0), at(1.0));
        for order in 0..2 {
            for axis in 0..3 {
                let measured = (behind[order][axis] - before[order][axis]) / (2.0 * step);
                let scale = 1.0 + here[2].iter().fold(0.0_f64, |most, value| most.max(value.abs())) * element.length.powi(2);
                prop_assert!((measured - here[order + 1][axis]).abs() <= 1e-4 * scale, "{order} {axis}");
            }
        }
        let travelled = (0..2_000).map(|k| {
            let [from, to] = [k, k + 1].map(|k| element.position(element.length * f64::from(k) / 2_000.0));
            (0..3).map(|axis| (to[axis] - from[axis]).powi(2)).sum::<f64>().sqrt()
        });
        prop_assert!((travelled.sum::<f64>() / element.length - 1.0).abs() <= 1e-6 + uneven);
    }
}

proptest! {
    #[test]
    fn tiny_and_huge_circles_far_away_are_analytic_too(
        x in -1e4..1e4_f64, y in -1e4..1e4_f64, heading in 0.0..TAU, radius_exponent in -4.0..6.0_f64,
        length in 0.1..1_000.0_f64, left in any::<bool>(), share in 0.0..1.0_f64,
    ) {
        let radius = 10.0_f64.powf(radius_exponent);
        let side = if left { 1.0 } else { -1.0 };
        let sweep = (length / radius).min(0.9 * TAU);
        // By heading and chord, which needs no centre: after θ the chord is 2·r·sin(θ/2), turned by θ/2.
        let at = |angle: f64| {
            let chord = 2.0 * radius * (0.5 * angle).sin();
            let direction = heading + side * 0.5 * angle;
            position(x + chord * direction.cos(), y + chord * direction.sin(), 0.0)
        };
        let center = [x - side * radius * heading.sin(), y + side * radius * heading.cos()];
        let arc = ArcGeometry { plane: Plane::Xy, center, clockwise: !left, sweep_rad: side * sweep };
        let element = element(at(0.0), at(sweep), Some(arc));
        prop_assert!((element.length - radius * sweep).abs() <= 1e-9);
        let found = element.position(share * element.length);
        for (found, wanted) in found.iter().zip(at(share * sweep)) {
            prop_assert!((found - wanted).abs() <= 1e-9, "{found} for {wanted}");
        }
        // No jump to the exact ends either. So near that the distance itself is a tenth of the bound at most.
        for (s, end) in [(1e-13, element.start), (1.0 - 1e-13, element.end)] {
            let near = element.position(s * element.length);
            prop_assert!((near[0] - end[0]).abs() <= 1e-9 && (near[1] - end[1]).abs() <= 1e-9, "{near:?} {end:?}");
        }
    }

    #[test]
    fn lines_are_analytic_far_away_too(
        from in prop::array::uniform3(-1e5..1e5_f64), by in prop::array::uniform3(-1e3..1e3_f64), share in 0.0..1.0_f64,
    ) {
        let to = [from[0] + by[0], from[1] + by[1], from[2] + by[2]];
        let line = element(position(from[0], from[1], from[2]), position(to[0], to[1], to[2]), None);
        let found = line.position(share * line.length);
        for axis in 0..3 {
            prop_assert!((found[axis] - (from[axis] + share * (to[axis] - from[axis]))).abs() <= 1e-9);
        }
    }

    #[test]
    fn an_arc_with_unequal_radii_stays_within_its_bounds(
        radius in 0.01..5.0_f64, error in -0.009..0.01_f64, start in 0.0..TAU, sweep in 0.001..TAU,
    ) {
        let at = |angle: f64, radius: f64| position(radius * angle.cos(), radius * angle.sin(), 0.0);
        let arc = ArcGeometry { plane: Plane::Xy, center: [0.0, 0.0], clockwise: false, sweep_rad: sweep };
        let element = element(at(start, radius), at(start + sweep, radius + error), Some(arc));
        let ((low, high), bound) = (element.extent(), element.largest_tangent());
        for k in 0..=1_000 {
            let s = element.length * f64::from(k) / 1_000.0;
            let (position, tangent) = (element.position(s), element.tangent(s));
            for axis in 0..2 {
                prop_assert!(position[axis] >= low[axis] - 1e-9 && position[axis] <= high[axis] + 1e-9);
                prop_assert!(tangent[axis].abs() <= bound[axis] * (1.0 + 1e-9) + 1e-12);
            }
        }
    }
}

#[test]
fn nothing_moves_nothing() {
    let here = position(1.0, 2.0, 3.0);
    assert!(Element::from_move(&moved(here, here, None), SourceSpan::default()).is_none());
}

#[test]
fn a_rotary_move_is_measured_in_degrees_and_rides_along_with_linear_ones() {
    let mut end = position(0.0, 0.0, 0.0);
    end[Axis::C.index()] = 90.0;
    assert_eq!(element(position(0.0, 0.0, 0.0), end, None).length, 90.0);
    end[0] = 3.0;
    end[1] = 4.0;
    let both = element(position(0.0, 0.0, 0.0), end, None);
    assert_eq!(both.length, 5.0);
    assert_eq!(both.position(2.5)[Axis::C.index()], 45.0);
}

#[test]
fn a_full_circle_returns_to_its_start() {
    let arc = ArcGeometry { plane: Plane::Zx, center: [0.0, 10.0], clockwise: true, sweep_rad: -TAU };
    let start = position(15.0, 0.0, 0.0);
    let circle = element(start, start, Some(arc));
    assert!((circle.length - TAU * 5.0).abs() < 1e-12);
    let (low, high) = circle.extent();
    assert!((low[0] - 5.0).abs() < 1e-12 && (high[0] - 15.0).abs() < 1e-12);
    assert!((low[2] + 5.0).abs() < 1e-12 && (high[2] - 5.0).abs() < 1e-12);
    // Clockwise about +Y from +X: first towards −Z (Z is the first axis of the plane).
    assert!(circle.position(circle.length * 0.25)[2] > 4.999 || circle.position(circle.length * 0.25)[2] < -4.999);
}
