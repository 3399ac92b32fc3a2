//! Another spindle speed for an oscillating section: its conditions are judged anew
//! (docs/functions/adaptive-feed.md, "Planned changes of the spindle speed").

use std::sync::Arc;

use feedwave_cutting::tool_oscillation::{NamedCondition, ToolGeometry};
use feedwave_cutting::{MachineProfile, Pipeline, PipelineConfig, SpindleTrial, Step, Tool, TrialStep};

use super::{condition, tool};

fn program(feed_mm_per_min: f64) -> String {
    format!("G21 G90 G17 G94 T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F{feed_mm_per_min}\nG203\nM30\n")
}

/// What is found at another speed, first.
fn judge(pipeline: &Pipeline, program: &str, ratio: f64) -> Result<(), String> {
    let mut trial = SpindleTrial::new(pipeline, ratio, 1.5).expect("at a place");
    loop {
        match trial.step() {
            TrialStep::NeedInput(place) => match program.as_bytes().get(place.offset as usize..) {
                Some(rest) if !rest.is_empty() => trial.push(rest),
                _ => trial.finish_input(),
            },
            TrialStep::More => {}
            TrialStep::Holds { .. } => return Ok(()),
            TrialStep::Fails(finding) => return Err(finding.code.to_string()),
        }
    }
}

/// The pipeline at the place before the section.
fn at_place(program: &str, radial_edge_length_mm: f64) -> Pipeline {
    let mut profile = MachineProfile::mill();
    profile.tool_oscillation = vec![NamedCondition {
        name: "accuracy".to_owned(),
        number: 1,
        tools: Vec::new(),
        condition: condition(),
        tables: Vec::new(),
    }];
    let geometry = ToolGeometry { radial_edge_length_mm, ..tool() };
    let tool = Tool { number: 4, geometry: Some(geometry), ..Tool::default() };
    let config =
        PipelineConfig { tools: vec![tool], spindle_changes: Some(Vec::new()), ..PipelineConfig::new(profile) };
    let mut pipeline = Pipeline::new(Arc::new(config));
    let mut block = pipeline.new_block();
    while pipeline.place_between().is_none() {
        match pipeline.next_block(&mut block) {
            Step::Block => {}
            Step::NeedInput(place) => pipeline.supply(place, program.as_bytes()),
            end => panic!("{end:?}: {:#?}", pipeline.findings()),
        }
    }
    pipeline
}

#[test]
fn the_step_per_period_is_judged_at_the_new_speed() {
    let program = program(600.0);
    let pipeline = at_place(&program, tool().radial_edge_length_mm);
    // 600 mm/min at 600 rev/min are a step of 1 mm per period, at 618 rev/min 0.97 mm, at 120 rev/min 5 mm: more than an
    // amplitude of 0.4 mm lifts the other edges over.
    assert_eq!(judge(&pipeline, &program, 1.03), Ok(()));
    let found = judge(&pipeline, &program, 0.2).unwrap_err();
    assert!(found.starts_with("OSC-"), "{found}");
}

#[test]
fn a_step_that_is_too_long_at_some_permitted_override_does_not_grow() {
    // At the override of 1.5 that the machine permits the step is 1.505 mm, longer than the edge, at 600 rev/min.
    let program = program(602.0);
    let pipeline = at_place(&program, 1.5);
    assert_eq!(judge(&pipeline, &program, 1.03), Ok(()));
    assert_eq!(judge(&pipeline, &program, 0.97).unwrap_err(), "OSC-OVERRIDE");
}
