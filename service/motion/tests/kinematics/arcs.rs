//! Arcs and helices of the tool centre point, in any plane and on any machine.

use feedwave_motion::kinematics::vector::{add, add_scaled, cross, norm, scale, sub, unit};
use feedwave_motion::kinematics::{FiveAxisBlock, TipCircle, TipCurve, TipPath, Toward};
use feedwave_program::Axis;
use proptest::prelude::*;

use super::five_axis::{block, point};
use super::machines::{a_direction, a_machine, a_point};
use super::properties::a_setup;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn the_tip_stays_on_its_arc(
        machine in a_machine(),
        setup in a_setup(),
        center_mm in a_point(200.0),
        normal in a_direction(),
        beside in a_direction(),
        radius_mm in 0.1..300.0_f64,
        sweep_rad in prop_oneof![-7.0..-0.01_f64, 0.01..7.0_f64],
        rise_mm in -30.0..30.0_f64,
        rotary in prop::array::uniform2(-100.0..100.0_f64),
        turn in prop_oneof![Just([0.0; 2]), prop::array::uniform2(-20.0..20.0_f64)],
    ) {
        let Some(first) = unit(cross(normal, beside)) else { return Ok(()) };
        let second = cross(normal, first);
        let exact = |share: f64| {
            let (sine, cosine) = (sweep_rad * share).sin_cos();
            let across = add(scale(first, radius_mm * cosine), scale(second, radius_mm * sine));
            add(add_scaled(center_mm, normal, rise_mm * share), across)
        };
        let Some(start) = point(&machine, &setup, exact(0.0), rotary) else { return Ok(()) };
        let to = [rotary[0] + turn[0], rotary[1] + turn[1]];
        let circle = TipCircle { center_mm, normal, sweep_rad };
        let wanted = FiveAxisBlock { curve: Some(TipCurve::Circle(circle)), ..block(exact(1.0), Toward::Angles(to)) };
        // The ranges and poses of the machine are the business of other tests.
        let Ok(motion) = machine.elements(&setup, &start, &wanted) else { return Ok(()) };
        prop_assert_eq!(motion.elements.len(), 1);
        let element = &motion.elements[0];
        let length_mm = (radius_mm * sweep_rad).hypot(rise_mm);
        prop_assert!((element.length - length_mm).abs() < 1e-9 * length_mm.max(1.0));
        prop_assert_eq!(element.position(0.0), start.position);
        prop_assert_eq!(element.position(element.length), motion.end.position);
        for k in 0..=97 {
            let share = f64::from(k) / 97.0;
            let s = element.length * share;
            let pose = machine.forward(&machine.from_position(&element.position(s)), &setup);
            let error = norm(sub(pose.tip_mm, exact(share)));
            prop_assert!(error < 1e-9, "tip {:e} at {}", error, share);
            for axis in [Axis::X, Axis::Y, Axis::Z] {
                let (mut place, mut tangent) = ([0.0], [0.0]);
                element.fill_work_axis(axis, &[s], &mut place);
                element.fill_work_tangent(axis, &[s], &mut tangent);
                prop_assert!((place[0] - exact(share)[axis.index()]).abs() < 1e-9);
                let step = 1e-6;
                let slope = (exact(share + step)[axis.index()] - exact(share - step)[axis.index()]) / (2.0 * step);
                prop_assert!((tangent[0] - slope / length_mm).abs() < 1e-6);
            }
        }
    }
}

#[test]
fn radii_that_differ_make_a_spiral_and_centres_on_an_end_nothing() {
    let circle = TipCircle { center_mm: [1.0, 2.0, 3.0], normal: [0.0, 0.0, 2.0], sweep_rad: std::f64::consts::PI };
    let path = TipPath::along(&circle, [6.0, 2.0, 3.0], [-4.004, 2.0, 5.0]).expect("an arc");
    assert_eq!(path.ends(), &[[6.0, 2.0, 3.0], [-4.004, 2.0, 5.0]]);
    let [x, y, z] = path.at(0.5);
    assert!((x - 1.0).abs() < 1e-12 && (y - 7.002).abs() < 1e-12 && (z - 4.0).abs() < 1e-12, "{x} {y} {z}");
    assert_eq!(TipPath::along(&circle, circle.center_mm, [6.0, 2.0, 3.0]), None);
    assert_eq!(TipPath::along(&circle, [6.0, 2.0, 3.0], circle.center_mm), None);
    assert_eq!(TipPath::along(&TipCircle { normal: [0.0; 3], ..circle }, [6.0, 2.0, 3.0], [0.0; 3]), None);
}
