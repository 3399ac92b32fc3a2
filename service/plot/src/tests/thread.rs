//! Pictures of threads.

use feedwave_cutting::thread::{
    DepthLaw, GrooveProfile, InfeedPattern, LeadAxis, PassMethod, SpindleRotation, StartUp, ThreadGeometry,
    ThreadLimits, ThreadPlan, ThreadRequest, ThreadSide, judge_thread, plan_thread,
};

use crate::figure::Figure;
use crate::{ThreadPictures, canvas, write_thread};

pub(super) fn figures() -> Vec<Figure> {
    let plans = [(ThreadSide::External, 1, 0.6), (ThreadSide::Internal, 3, 0.25)];
    let figures = plans.map(|(side, starts, first_depth_mm)| {
        let plan = plan(side, starts, first_depth_mm);
        let pictures = ThreadPictures { name: "thread".to_owned(), job: &plan.job, report: &plan.report };
        crate::thread::figures(&pictures)
    });
    figures.concat()
}

fn plan(side: ThreadSide, starts: u32, first_depth_mm: f64) -> ThreadPlan {
    let geometry = ThreadGeometry {
        lead_axis: LeadAxis::Z,
        side,
        work_mm: 10.0,
        start_mm: 10.0,
        end_mm: -20.0,
        taper: 0.02,
        lead_mm: 2.0 * f64::from(starts),
        starts,
        rotation: SpindleRotation::Forward,
    };
    let request = ThreadRequest {
        geometry,
        hand: None,
        profile: GrooveProfile::pointed(60.0),
        depth_mm: 1.2,
        finishing_allowance_mm: 0.02,
        first_depth_mm,
        infeed: InfeedPattern::Flank,
        law: DepthLaw::SquareRoot,
        method: PassMethod::StartAngle,
        start_up: StartUp::Preparatory,
        vibrations_per_rev: 1.5,
        spindle_rev_per_min: 200.0,
        amplitude_margin: 1.1,
        limits: ThreadLimits { finishing_thickness_mm: Some(0.1), ..ThreadLimits::default() },
    };
    plan_thread(&request).unwrap()
}

#[test]
fn a_thread_has_three_pictures_whatever_its_passes() {
    for (side, starts, first_depth_mm) in [(ThreadSide::External, 1, 0.6), (ThreadSide::Internal, 3, 0.25)] {
        let plan = plan(side, starts, first_depth_mm);
        let pictures = ThreadPictures { name: "thread".to_owned(), job: &plan.job, report: &plan.report };
        let figures = crate::thread::figures(&pictures);
        let names: Vec<_> = figures.iter().map(|figure| figure.name.as_str()).collect();
        assert_eq!(names, ["thread-unrolled", "thread-position", "thread-section"]);
        let text = |name: &str| canvas::svg_text(figures.iter().find(|figure| figure.name == name).unwrap()).unwrap();
        for (name, wanted) in [
            ("thread-unrolled", ["spindle angle (360 degrees are", "Z, mm", "in the air with the full section"]),
            ("thread-position", ["spindle angle, degrees", "X (radius), mm", "a ribbon holds the chip"]),
            ("thread-section", ["along Z from the tip", "finished groove", "most is left at"]),
            ("thread-unrolled", ["magnified", "no vibration", "mm of the circumference), degrees"]),
        ] {
            let text = text(name);
            for wanted in wanted {
                assert!(text.contains(wanted), "{name}: {wanted}");
            }
        }
        if starts > 1 {
            assert!(text("thread-section").contains("first of 3 starts"));
        }
    }
}

#[test]
fn an_impossible_thread_has_none() {
    let mut job = plan(ThreadSide::External, 1, 0.6).job;
    job.geometry.lead_mm = f64::NAN;
    let report = judge_thread(&job, &ThreadLimits::default());
    let directory = tempfile::tempdir().unwrap();
    let pictures = ThreadPictures { name: "thread".to_owned(), job: &job, report: &report };
    assert!(write_thread(&pictures, directory.path()).unwrap().is_empty());
}
