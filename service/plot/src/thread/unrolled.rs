//! The unrolled work: the spindle angle to the right, the axis of the lead upwards, the paths of all passes as ribbons that are wide where
//! the tool is deep and narrow where it retreats.

use feedwave_cutting::thread::LeadAxis;

use super::super::figure::{Axis, Beside, DEGREES, Figure, MM, Panel};
use super::super::theme::{self, Ink};
use super::{Groove, cut_through, stretches};

/// Leads shown.
const LEADS: f64 = 2.0;
/// Degrees from one point to the next.
const STEP_DEG: f64 = 1.0;
/// Share of a pitch that the lanes of its passes fill.
const LANES_SHARE: f64 = 0.86;
/// Largest half width of a ribbon, and the smallest, as shares of a lane.
const WIDE: f64 = 0.44;
const NARROW: f64 = 0.05;
/// Least share of a lead that a lane with a number in it takes.
const LABELLED_SHARE: f64 = 0.06;

/// The unrolled work.
pub(super) struct UnrolledPicture<'a> {
    pub(super) groove: &'a Groove<'a>,
}

impl UnrolledPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let groove = self.groove;
        let circumference_mm = std::f64::consts::TAU * groove.job.geometry.winding_radius_mm();
        // On a face every turn is of another length.
        let place = match groove.job.geometry.lead_axis {
            LeadAxis::Z => "",
            LeadAxis::X => ", at its largest",
        };
        let label = format!("spindle angle (360 degrees are {circumference_mm:.2} mm of the circumference{place})");
        let x = Axis::new(label, DEGREES.of_circumference(circumference_mm / 360.0), 0.0..360.0);
        let lane_mm = self.lane_mm();
        let lead_mm = groove.job.geometry.lead_mm;
        let z = |travel_mm: f64| groove.job.geometry.along_mm(travel_mm);
        let first_mm = self.first_travel_mm();
        let edges = [z(first_mm - lane_mm), z(first_mm + LEADS * lead_mm + lane_mm)];
        let y = Axis::new(groove.along_name(), MM, edges[0].min(edges[1])..edges[0].max(edges[1]));
        let mut panel = Panel::new("a ribbon is wide where the tool is deep, narrow where it retreats", x, y);
        panel.note("passes are drawn side by side in their order, pass 1 in its place");
        for (place, &index) in groove.passes.iter().enumerate() {
            self.add_pass(&mut panel, place, index);
        }
        let title = "Unrolled work: the paths of all passes";
        Figure::new(format!("{}-unrolled", groove.name), title, groove.subtitle(), panel)
    }

    /// Distance of the lanes of two passes, mm.
    fn lane_mm(&self) -> f64 {
        LANES_SHARE * self.groove.job.geometry.pitch_mm() / self.groove.passes.len() as f64
    }

    /// Travel at the left edge: where the lead axis is in step in every pass, at the same spindle angle.
    fn first_travel_mm(&self) -> f64 {
        let job = self.groove.job;
        let first = &job.passes[self.groove.passes[0]];
        let latest_deg = self.groove.passes.iter().map(|index| job.passes[*index].start_angle_deg).fold(0.0, f64::max);
        let turns = ((latest_deg + job.run_up.angle_deg) / 360.0).ceil();
        job.position(first, 360.0 * turns).travel_mm
    }

    /// One pass: a ribbon for each revolution.
    fn add_pass(&self, panel: &mut Panel, place: usize, index: usize) {
        let groove = self.groove;
        let (lane_mm, lead_mm) = (self.lane_mm(), groove.job.geometry.lead_mm);
        let [_, section] = groove.clearances(index);
        let pass = groove.pass(index);
        let shifted_mm = self.first_travel_mm() + lane_mm * place as f64;
        let steps = (360.0 / STEP_DEG) as u32;
        for turn in 0..=LEADS as u32 {
            let angles = (0..=steps).map(|step| f64::from(step) * STEP_DEG);
            let mut edges = [Vec::new(), Vec::new()];
            let (mut air, mut halves) = (Vec::new(), Vec::new());
            for angle_deg in angles {
                let work_deg = 360.0 * f64::from(turn) + angle_deg;
                let middle_mm = shifted_mm + lead_mm * (work_deg / 360.0 - 1.0);
                let out = if pass.vibrates() { groove.retreat_mm(index, work_deg) / pass.amplitude_mm } else { 0.0 };
                let half_mm = lane_mm * (WIDE + (NARROW - WIDE) * out);
                halves.push(half_mm);
                edges[0].push((angle_deg, groove.job.geometry.along_mm(middle_mm - half_mm)));
                edges[1].push((angle_deg, groove.job.geometry.along_mm(middle_mm + half_mm)));
                air.push(pass.vibrates() && section.at_mm(groove.phase_deg(work_deg)) >= 0.0);
            }
            let in_air = Ink { mark: theme::Mark::Fill { opacity: 0.9 }, ..cut_through() };
            for (ink, wanted) in [(groove.fill(place), false), (in_air, true)] {
                let shown = |step: usize| air[step] == wanted || step > 0 && air[step - 1] == wanted;
                let pairs = stretches(&edges[0], shown).into_iter().zip(stretches(&edges[1], shown));
                for (low, high) in pairs {
                    panel.area(&ink, low.into_iter().chain(high.into_iter().rev()).collect());
                }
            }
            if turn == 1 && lane_mm > LABELLED_SHARE * lead_mm {
                // Where the ribbon is wide.
                let wide = |step: &usize| halves[*step] > 0.97 * lane_mm * WIDE;
                let step = (10..=steps as usize).find(wide).unwrap_or_default();
                let (low, high) = (edges[0][step], edges[1][step]);
                let at = (low.0, 0.5 * (low.1 + high.1));
                panel.label(at, (index + 1).to_string(), theme::INK, Beside::CENTER);
            }
        }
    }
}
