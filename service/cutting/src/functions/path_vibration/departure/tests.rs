use proptest::prelude::*;

use super::*;

/// What junctions add for an offset that begins right at one of them, by the sum over all.
fn largest(junctions: &[(f64, f64)], offset_mm: f64) -> f64 {
    let reached = |from_mm: f64, forwards: bool| -> f64 {
        let reach = |at_mm: f64| if forwards { at_mm - from_mm } else { from_mm - at_mm };
        let within = junctions.iter().filter(|(at_mm, _)| reach(*at_mm) >= 0.0);
        within.map(|(at_mm, change)| (offset_mm - reach(*at_mm)).max(0.0) * change).sum()
    };
    junctions.iter().map(|(at_mm, _)| reached(*at_mm, true).max(reached(*at_mm, false))).fold(0.0, f64::max)
}

fn found(junctions: &[(f64, f64)], offset_mm: f64) -> JunctionReach {
    let mut reach = JunctionReach::new(offset_mm);
    for (line, (at_mm, change)) in (1..).zip(junctions) {
        reach.add(*at_mm, *change, line);
    }
    reach
}

#[test]
fn one_junction_turns_the_offset_and_chords_are_as_the_arc() {
    let one = found(&[(3.0, 1e-3)], 0.1);
    let (departure_mm, line) = one.largest.unwrap();
    assert!((departure_mm - 1e-4).abs() < 1e-18 && line == 1);
    assert_eq!(found(&[(3.0, 1e-17)], 0.1).largest, None, "the rounding of tangents");
    // Chords of 0.01 mm of a circle of 10 mm.
    let chords: Vec<_> = (0..1_000).map(|chord| (0.01 * f64::from(chord), 1e-3)).collect();
    let departure_mm = found(&chords, 0.3).departure().departure_mm;
    let arc_mm = 0.5 * 0.3 * 0.3 / 10.0;
    assert!((1.0..1.08).contains(&(departure_mm / arc_mm)), "{departure_mm} of {arc_mm}");
}

#[test]
fn parts_are_apart_and_memory_does_not_grow_with_the_section() {
    let mut reach = JunctionReach::new(0.1);
    reach.add(1.0, 1e-3, 4);
    reach.interrupt();
    reach.add(1.01, 1e-3, 5);
    assert!((reach.largest.unwrap().0 - 1e-4).abs() < 1e-18);
    for junction in 0..100_000 {
        reach.add(2.0 + 1e-5 * f64::from(junction), 1e-6, 6);
    }
    assert!(reach.within.len() <= 66, "{}", reach.within.len());
}

#[test]
fn the_largest_offset_is_where_the_departure_is_the_tolerance() {
    let at = |offset_mm, departure_mm| JunctionDeparture { offset_mm, departure_mm };
    for curvature_per_mm in [0.0, 1e-9, 0.25] {
        for at_junctions in [[at(0.1, 0.0), at(1.0, 0.0)], [at(0.1, 1e-4), at(1.0, 2e-3)]] {
            let departure = Departure { curvature_per_mm, at_junctions };
            for tolerance_mm in [5e-5, 1e-4, 2e-3, 0.02] {
                let largest_mm = departure.largest_offset_mm(tolerance_mm);
                if largest_mm.is_finite() {
                    let there = departure.of_mm(largest_mm);
                    let beyond = departure.of_mm(largest_mm * (1.0 + 1e-9) + 1e-12);
                    assert!(there <= tolerance_mm * (1.0 + 1e-12), "{departure:?} {tolerance_mm}");
                    assert!(beyond >= tolerance_mm, "{departure:?} {tolerance_mm}");
                } else {
                    assert_eq!(departure.of_mm(1.0), 0.0);
                }
            }
        }
    }
}

proptest! {
    #[test]
    fn it_is_a_bound_and_close(
        steps in prop::collection::vec((-4.0..0.0_f64, 0.0..1e-3_f64), 1..80),
        offset_mm in 0.01..1.0_f64,
    ) {
        let mut at_mm = 0.0;
        let junctions: Vec<(f64, f64)> = steps.iter().map(|(exponent, change)| {
            at_mm += 10.0_f64.powf(*exponent);
            (at_mm, *change)
        }).collect();
        let exact = largest(&junctions, offset_mm);
        let found_mm = found(&junctions, offset_mm).departure().departure_mm;
        let change: f64 = junctions.iter().map(|(_, change)| change).sum();
        prop_assert!(found_mm >= exact * (1.0 - 1e-12), "{} of {}", found_mm, exact);
        prop_assert!(found_mm <= exact + TOGETHER_SHARE * offset_mm * change, "{} of {}", found_mm, exact);
    }

    /// A smaller offset departs less than in proportion, a larger one up to the permitted as that.
    #[test]
    fn what_is_known_of_two_offsets_bounds_all_others(
        steps in prop::collection::vec((-4.0..0.0_f64, 0.0..1e-3_f64), 1..40),
        programmed_mm in 0.01..1.0_f64,
        tried_mm in 0.001..1.0_f64,
    ) {
        let mut at_mm = 0.0;
        let junctions: Vec<(f64, f64)> = steps.iter().map(|(exponent, change)| {
            at_mm += 10.0_f64.powf(*exponent);
            (at_mm, *change)
        }).collect();
        let at_junctions = [programmed_mm, 1.0].map(|offset_mm| found(&junctions, offset_mm).departure());
        let departure = Departure { curvature_per_mm: 0.0, at_junctions };
        prop_assert!(departure.of_mm(tried_mm) >= largest(&junctions, tried_mm) * (1.0 - 1e-12));
    }
}
