//! Where within a turn an edge has a chip, and how thick it is.

use std::f64::consts::{PI, TAU};

/// Least cosine of the angle at which a chip begins or ends: where a chip is only just one, it moves without bound.
const LEAST_COSINE: f64 = 1e-3;

/// A stretch of the turn of an edge with a chip of the thickness `feed_mm`·sin φ + `extra_mm`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Chip {
    /// Angle of the edge at which it begins, rad, 0 to π.
    pub from_rad: f64,
    /// At which it ends.
    pub to_rad: f64,
    /// Feed since the last edge that cut here.
    pub feed_mm: f64,
    /// What the run-out adds.
    pub extra_mm: f64,
    /// The same by the cosine and the sine of the run-out over the edges.
    pub extra: [f64; 2],
    /// By how much sooner it begins with what the chip is thicker, rad/mm: 0 where the edge enters, or another edge is the one before.
    pub sooner: f64,
    /// By how much later it ends.
    pub later: f64,
}

/// Radii of edges, by the cosine and the sine of the run-out over them.
fn radius(edge: u32, edges: u32) -> [f64; 2] {
    let (sine, cosine) = libm::sincos(TAU / f64::from(edges) * f64::from(edge));
    [cosine, sine]
}

/// Chips of an edge in the arc from `entry_rad` to `exit_rad`, ascending.
///
/// Edge j finds what the edges before left: h = min over m of m·c·sin φ + r_j − r_(j−m), with the feed per edge c and the radii r, and no chip
/// where that is not above 0 (Kline and DeVor 1983). Over sin φ that is a chain of straight lines, bent downwards: the more feed, the sooner the edge just
/// before is the one that counts.
pub(super) fn chips(
    edge: u32,
    edges: u32,
    per_edge_mm: f64,
    run_out_mm: [f64; 2],
    [entry_rad, exit_rad]: [f64; 2],
) -> Vec<Chip> {
    let own = radius(edge, edges);
    // By the number of edges back.
    let lines: Vec<Chip> = (1..=edges)
        .map(|back| {
            let other = radius((edge + edges - back % edges) % edges, edges);
            let extra = [own[0] - other[0], own[1] - other[1]];
            let extra_mm = extra[0] * run_out_mm[0] + extra[1] * run_out_mm[1];
            let feed_mm = f64::from(back) * per_edge_mm;
            Chip { from_rad: 0.0, to_rad: 0.0, feed_mm, extra_mm, extra, sooner: 0.0, later: 0.0 }
        })
        .collect();
    let chain = chain(&lines);
    let mut chips = Vec::new();
    // As the chip grows, and as it becomes thinner.
    for (number, &(from, to, line)) in chain.iter().enumerate() {
        let moves = if number == 0 { 1.0 / (line.feed_mm * cosine(from)) } else { 0.0 };
        let [begins, ends] = [from, to].map(libm::asin);
        let sooner = if begins > entry_rad { moves } else { 0.0 };
        let chip = Chip { from_rad: begins.max(entry_rad), to_rad: ends.min(exit_rad), sooner, ..line };
        chips.extend((chip.from_rad < chip.to_rad).then_some(chip));
    }
    for (number, &(from, to, line)) in chain.iter().enumerate().rev() {
        let moves = if number == 0 { 1.0 / (line.feed_mm * cosine(from)) } else { 0.0 };
        let [begins, ends] = [PI - libm::asin(to), PI - libm::asin(from)];
        let later = if ends < exit_rad { moves } else { 0.0 };
        let chip = Chip { from_rad: begins.max(entry_rad), to_rad: ends.min(exit_rad), later, ..line };
        chips.extend((chip.from_rad < chip.to_rad).then_some(chip));
    }
    chips
}

fn cosine(sine: f64) -> f64 {
    (1.0 - sine * sine).max(0.0).sqrt().max(LEAST_COSINE)
}

/// The least of the lines over the sine, where it is above 0: from where to where which of them.
fn chain(lines: &[Chip]) -> Vec<(f64, f64, Chip)> {
    let zero = |line: &Chip| -line.extra_mm / line.feed_mm;
    // The last to come above 0; of several the one that rises least is the least from there on.
    let Some(mut line) = lines.iter().rev().max_by(|a, b| zero(a).total_cmp(&zero(b))) else { return Vec::new() };
    let mut from = zero(line).max(0.0);
    let mut chain = Vec::new();
    while from < 1.0 {
        let crossing = |other: &Chip| (other.extra_mm - line.extra_mm) / (line.feed_mm - other.feed_mm);
        let flatter = lines.iter().filter(|other| other.feed_mm < line.feed_mm);
        // Of several that cross here the flattest one.
        let next = flatter
            .rev()
            .map(|other| (crossing(other).max(from), other))
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.feed_mm.total_cmp(&b.1.feed_mm)));
        let to = next.map_or(1.0, |(to, _)| to.min(1.0));
        if to > from {
            chain.push((from, to, *line));
        }
        let Some((_, other)) = next else { break };
        (from, line) = (to, other);
    }
    chain
}

/// Angle in 0 to 2π.
pub(super) fn within_a_turn(angle_rad: f64) -> f64 {
    let turned = angle_rad - TAU * (angle_rad / TAU).floor();
    if turned < TAU { turned } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chips_are_what_the_edges_before_left() {
        const EDGES: u32 = 5;
        for (run_out_mm, arc) in [
            ([0.0, 0.0], [0.0, PI]),
            ([0.004, -0.003], [0.0, PI]),
            ([0.02, 0.011], [0.3, 2.2]),
            ([-0.03, 0.05], [1.0, PI]),
            ([0.2, 0.0], [0.0, PI]),
        ] {
            for edge in 0..EDGES {
                let chips = chips(edge, EDGES, 0.05, run_out_mm, arc);
                let radius_mm = |edge: u32| {
                    let [a, b] = radius(edge % EDGES, EDGES);
                    a * run_out_mm[0] + b * run_out_mm[1]
                };
                for step in 0..4_000 {
                    let angle_rad = f64::from(step) * TAU / 4_000.0 + 1e-7;
                    let sine = libm::sin(angle_rad);
                    let left = (1..=EDGES)
                        .map(|back| f64::from(back) * 0.05 * sine + radius_mm(edge) - radius_mm(edge + EDGES - back));
                    let thickness_mm = left.fold(f64::INFINITY, f64::min).max(0.0);
                    let is_in = (arc[0]..arc[1]).contains(&angle_rad);
                    let expected_mm = if is_in { thickness_mm } else { 0.0 };
                    let found = chips.iter().filter(|chip| (chip.from_rad..chip.to_rad).contains(&angle_rad));
                    let found_mm: f64 = found.map(|chip| chip.feed_mm * sine + chip.extra_mm).sum();
                    assert!((found_mm - expected_mm).abs() < 1e-9, "{edge} {angle_rad}: {found_mm} {expected_mm}");
                }
                assert!(chips.windows(2).all(|pair| pair[0].to_rad <= pair[1].from_rad + 1e-12), "{chips:?}");
            }
        }
    }

    #[test]
    fn a_thicker_chip_begins_sooner_and_ends_later() {
        const MORE_MM: f64 = 1e-7;
        let of = |first_mm: f64| chips(0, 4, 0.05, [first_mm, 0.006], [0.0, PI]);
        let (chips, thicker) = (of(-0.01), of(-0.01 + MORE_MM));
        let (first, last) = (chips[0], chips[chips.len() - 1]);
        assert!(first.sooner > 0.0 && last.later > 0.0, "{chips:?}");
        for (moves, moved) in [
            (first.sooner * first.extra[0], first.from_rad - thicker[0].from_rad),
            (last.later * last.extra[0], thicker[thicker.len() - 1].to_rad - last.to_rad),
        ] {
            assert!((moved / MORE_MM / moves - 1.0).abs() < 1e-4, "{moves} {moved}");
        }
    }
}
