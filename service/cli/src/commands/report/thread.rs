//! Threads for people: their passes, what becomes of their chips, what is left for the finishing pass.

use feedwave_contract::proto::{
    CrestReport, GrooveProfile, SpindleRotation, Thread, ThreadChip, ThreadFollowing, ThreadGeometry, ThreadLeadAxis,
    ThreadPass, ThreadPassReport, ThreadReport, ThreadSectionReport, ThreadSide, ThreadStartUp, ValidationReport,
};

use super::super::terminal::{Style, number};
use super::{Rows, percent, sections};

/// Passes listed; the JSON has all.
const LISTED_PASSES: usize = 40;

/// The threads of a program.
pub(super) fn sections_text(report: &ValidationReport, style: Style) -> String {
    let count = report.summary.as_ref().map(|summary| summary.thread_count);
    sections(&report.threads, count, "thread", |number, section| section_text(number, section, style))
}

fn section_text(position: usize, section: &ThreadSectionReport, style: Style) -> String {
    let switched = section.on_line.map_or_else(
        || "without vibration".to_owned(),
        |line| match section.amplitude_ratio {
            Some(ratio) => format!("vibration on in line {line}, ratio {}", number(ratio, 4)),
            None => format!("vibration on in line {line}"),
        },
    );
    let heading = format!("Thread {position}: lines {} to {}, {switched}", section.first_line, section.last_line);
    let (thread, report) = (section.thread.clone().unwrap_or_default(), section.report.clone().unwrap_or_default());
    let mut text = text(&heading, &thread, &report, style);
    if section.work_diameter_assumed {
        let mut rows = Rows::new(style);
        rows.row("", "the work's diameter is assumed: no word states it");
        text.push_str(&rows.text);
    }
    text
}

/// A thread with its report under a heading.
pub(in super::super) fn text(heading: &str, thread: &Thread, report: &ThreadReport, style: Style) -> String {
    let mut rows = Rows::new(style);
    rows.heading(heading);
    let geometry = thread.geometry.unwrap_or_default();
    rows.row("thread", geometry_text(&geometry));
    rows.row("tool", tool_text(&thread.profile.unwrap_or_default()));
    if thread.passes.iter().any(|pass| pass.amplitude_mm > 0.0) {
        rows.row("vibration", vibration_text(thread, report));
    }
    rows.row(
        "lead axis",
        format!(
            "{} mm/s at {} rev/min, in step after {} degrees of the spindle and {} mm; {} mm of exact lead",
            number(report.lead_velocity_mm_per_s, 4),
            number(thread.spindle_rev_per_min, 5),
            number(thread.run_up_angle_deg, 4),
            number(report.run_up_travel_mm, 4),
            number(report.exact_length_mm, 5)
        ),
    );
    if !report.passes.is_empty() {
        pass_table(&mut rows, thread, &report.passes);
        chip_table(&mut rows, &report.passes);
        ratio_row(&mut rows, report);
    }
    if let Some(crests) = &report.crests {
        let across = match geometry.lead_axis() {
            ThreadLeadAxis::X => "along Z",
            ThreadLeadAxis::Z | ThreadLeadAxis::Unspecified => "on the radius",
        };
        crest_rows(&mut rows, crests, across);
    }
    if let Some(following) = &report.following {
        following_rows(&mut rows, following);
    }
    rows.text
}

/// What arrives at the tool.
fn following_rows(rows: &mut Rows, following: &ThreadFollowing) {
    rows.row(
        "tool",
        format!(
            "{} of the vibration arrive, {} degrees late; the lead axis is {} mm behind the spindle",
            percent(following.gain),
            number(following.lag_deg, 4),
            number(following.lead_lag_mm, 4)
        ),
    );
    if following.contour_error_mm > 0.0 {
        let beside = number(following.contour_error_mm, 4);
        rows.row("contour", format!("the taper is cut {beside} mm beside, because the axes lag differently"));
    }
    let head = ["pass", "arrives, mm", "above its depth, mm", "command A, mm", "at depth, mm", "shift, deg", "chip"];
    let mut table = vec![head.map(str::to_owned).to_vec()];
    let passes = following.passes.iter().enumerate().filter(|(_, pass)| pass.arriving_amplitude_mm > 0.0);
    let or_none = |value: Option<f64>| value.map_or_else(|| "none".to_owned(), |value| number(value, 4));
    table.extend(passes.take(LISTED_PASSES).map(|(index, pass)| {
        let chip = match (pass.depth_broken, pass.section_broken) {
            (true, true) => "broken",
            (true, false) => "in depth only",
            (false, _) => "unbroken",
        };
        vec![
            (index + 1).to_string(),
            number(pass.arriving_amplitude_mm, 4),
            number(pass.above_depth_mm, 4),
            or_none(pass.amplitude_to_command_mm),
            or_none(pass.depth_to_command_mm),
            number(pass.phase_shift_to_command_deg, 5),
            chip.to_owned(),
        ]
    }));
    if table.len() > 1 {
        rows.table(&table);
    }
}

fn geometry_text(geometry: &ThreadGeometry) -> String {
    let side = match geometry.side() {
        ThreadSide::Internal => "internal",
        ThreadSide::External | ThreadSide::Unspecified => "external",
    };
    let spindle = match geometry.rotation() {
        SpindleRotation::Reverse => "M4",
        SpindleRotation::Forward | SpindleRotation::Unspecified => "M3",
    };
    if geometry.lead_axis() == ThreadLeadAxis::X {
        return face_text(geometry, spindle);
    }
    // M3 towards the chuck makes a right-hand thread.
    let right = (geometry.end_z_mm < geometry.start_z_mm) == (spindle == "M3");
    let hand = if right { "right-hand" } else { "left-hand" };
    let starts = starts_text(geometry.starts);
    let taper = match geometry.taper {
        0.0 => String::new(),
        taper => format!(", taper {} mm/mm on the radius", number(taper, 4)),
    };
    format!(
        "{side}, {hand} ({spindle}), on {} mm diameter{taper}, lead {} mm{starts}, Z {} to {} mm",
        number(geometry.work_diameter_mm, 6),
        number(geometry.lead_mm, 6),
        number(geometry.start_z_mm, 6),
        number(geometry.end_z_mm, 6)
    )
}

/// A thread along X.
fn face_text(geometry: &ThreadGeometry, spindle: &str) -> String {
    let taper = match geometry.taper {
        0.0 => String::new(),
        taper => format!(", taper {} mm/mm", number(taper, 4)),
    };
    format!(
        "along X ({spindle}), on a face at Z {} mm{taper}, lead {} mm{}, X {} to {} mm diameter",
        number(geometry.face_z_mm, 6),
        number(geometry.lead_mm, 6),
        starts_text(geometry.starts),
        number(2.0 * geometry.start_radius_mm, 6),
        number(2.0 * geometry.end_radius_mm, 6)
    )
}

fn starts_text(starts: u32) -> String {
    match starts {
        0 | 1 => String::new(),
        starts => format!(" in {starts} starts"),
    }
}

fn tool_text(profile: &GrooveProfile) -> String {
    let tip = match profile.root_flat_mm {
        0.0 => "pointed".to_owned(),
        flat_mm => format!("root flat {} mm", number(flat_mm, 4)),
    };
    format!("{} degrees included, {tip}", number(profile.included_angle_deg, 4))
}

fn vibration_text(thread: &Thread, report: &ThreadReport) -> String {
    let start_up = match thread.start_up() {
        ThreadStartUp::Delayed => "delayed start",
        ThreadStartUp::Preparatory | ThreadStartUp::Unspecified => "preparatory movement",
    };
    format!(
        "D = {} per revolution of the spindle, {} Hz, {start_up}",
        number(thread.vibrations_per_rev, 5),
        number(report.frequency_hz, 4)
    )
}

/// How the passes are cut.
fn pass_table(rows: &mut Rows, thread: &Thread, reports: &[ThreadPassReport]) {
    let has_lines = thread.passes.iter().any(|pass| pass.line > 0);
    let several_starts = thread.geometry.is_some_and(|geometry| geometry.starts > 1);
    let mut head = vec!["pass"];
    if has_lines {
        head.push("line");
    }
    if several_starts {
        head.push("start");
    }
    head.extend(["depth, mm", "infeed, mm", "amplitude A, mm", "shift, deg", "on the work, deg"]);
    head.extend(["start angle Q, deg", "start, mm later"]);
    let mut table = vec![head.into_iter().map(str::to_owned).collect::<Vec<_>>()];
    let row = |(index, (pass, report)): (usize, (&ThreadPass, &ThreadPassReport))| {
        let mut row = vec![(index + 1).to_string()];
        if has_lines {
            row.push(pass.line.to_string());
        }
        if several_starts {
            row.push((pass.start + 1).to_string());
        }
        let vibrates = pass.amplitude_mm > 0.0;
        let angle = |value: f64| if vibrates { number(value, 6) } else { "–".to_owned() };
        row.extend([
            number(pass.depth_mm, 5),
            number(report.infeed_mm, 4),
            if vibrates { number(pass.amplitude_mm, 5) } else { "none".to_owned() },
            angle(pass.phase_shift_deg),
            angle(report.work_phase_shift_deg),
            number(pass.start_angle_deg, 6),
            number(pass.start_travel_mm, 5),
        ]);
        row
    };
    table.extend(thread.passes.iter().zip(reports).enumerate().take(LISTED_PASSES).map(row));
    rows.table(&table);
    rows.more(reports.len().saturating_sub(LISTED_PASSES) as u64);
}

/// What becomes of the chips, model by model.
fn chip_table(rows: &mut Rows, reports: &[ThreadPassReport]) {
    rows.text.push('\n');
    let head = ["chip of pass", "depth only", "air", "breaks/rev", "longest, mm"];
    let section = ["full section", "air", "breaks/rev", "longest, mm", "needs A, mm", "thickest, mm"];
    let mut table = vec![head.iter().chain(&section).map(|cell| (*cell).to_owned()).collect::<Vec<_>>()];
    for (index, report) in reports.iter().enumerate().take(LISTED_PASSES) {
        if report.amplitude_mm <= 0.0 {
            continue;
        }
        let (depth, section) = (report.depth.unwrap_or_default(), report.section.unwrap_or_default());
        let mut row = vec![(index + 1).to_string()];
        row.extend(chip_cells(&depth));
        row.extend(chip_cells(&section));
        row.push(number(section.least_amplitude_mm, 4));
        row.push(number(section.largest_thickness_mm, 3));
        table.push(row);
    }
    if table.len() > 1 {
        rows.table(&table);
    }
}

fn chip_cells(chip: &ThreadChip) -> [String; 4] {
    [
        if chip.broken { "broken" } else { "unbroken" }.to_owned(),
        percent(chip.air_share),
        number(chip.breaks_per_rev, 3),
        number(chip.longest_chip_mm, 3),
    ]
}

fn ratio_row(rows: &mut Rows, report: &ThreadReport) {
    let part = |ratio: Option<f64>, what: &str| ratio.map(|ratio| format!("{} {what}", number(ratio, 4)));
    let parts = [
        part(report.least_amplitude_ratio, "for the depth"),
        part(report.least_section_amplitude_ratio, "for the full section"),
    ];
    let parts: Vec<_> = parts.into_iter().flatten().collect();
    if !parts.is_empty() {
        rows.row("least ratio", format!("amplitude over infeed from {} on", parts.join(" and ")));
    }
}

/// `across` says in which direction depths are.
fn crest_rows(rows: &mut Rows, crests: &CrestReport, across: &str) {
    rows.row(
        "crests",
        format!(
            "pass {} leaves {} mm {across} ({} mm with the flanks)",
            crests.pass + 1,
            number(crests.crest_mm, 3),
            number(crests.section_crest_mm, 3)
        ),
    );
    if crests.finishing_infeed_mm > 0.0 || crests.finishing_thickness_mm > 0.0 {
        rows.row(
            "finishing",
            format!(
                "infeed {} mm, finds up to {} mm; one more vibrating pass would leave crests of {} mm",
                number(crests.finishing_infeed_mm, 3),
                number(crests.finishing_thickness_mm, 3),
                number(crests.crest_with_another_pass_mm, 3)
            ),
        );
    }
}
