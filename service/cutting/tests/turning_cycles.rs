//! Programs of lathes as posts write them: accepted with the profile that they need, and resumed in the middle of their cycles.

use crate::common::{all_bits, resume, run, run_in_pieces, snapshots, validate};
use feedwave_cutting::{MachineProfile, PipelineConfig, Tool};
use feedwave_program::{DrillingStyle, GCodeSystem, LanguageSettings, ToolOffset};

/// The programs, and the G-code system of their control: none for LinuxCNC.
const PROGRAMS: [(&str, &str, Option<GCodeSystem>); 12] = [
    ("od-rough-finish", include_str!("../../../tests/fixtures/lathe/od-rough-finish.nc"), Some(GCodeSystem::A)),
    ("bore-rough-finish", include_str!("../../../tests/fixtures/lathe/bore-rough-finish.nc"), Some(GCodeSystem::A)),
    ("facing-g72", include_str!("../../../tests/fixtures/lathe/facing-g72.nc"), Some(GCodeSystem::A)),
    ("pattern-g73", include_str!("../../../tests/fixtures/lathe/pattern-g73.nc"), Some(GCodeSystem::A)),
    ("grooves-g75", include_str!("../../../tests/fixtures/lathe/grooves-g75.nc"), Some(GCodeSystem::A)),
    ("peck-g74", include_str!("../../../tests/fixtures/lathe/peck-g74.nc"), Some(GCodeSystem::A)),
    ("threads-g76-g92", include_str!("../../../tests/fixtures/lathe/threads-g76-g92.nc"), Some(GCodeSystem::A)),
    ("macro-contour", include_str!("../../../tests/fixtures/lathe/macro-contour.nc"), Some(GCodeSystem::A)),
    ("pockets-type-2", include_str!("../../../tests/fixtures/lathe/pockets-type-2.nc"), Some(GCodeSystem::A)),
    ("system-b", include_str!("../../../tests/fixtures/lathe/system-b.nc"), Some(GCodeSystem::B)),
    ("system-c", include_str!("../../../tests/fixtures/lathe/system-c.nc"), Some(GCodeSystem::C)),
    ("linuxcnc-g71", include_str!("../../../tests/fixtures/lathe/linuxcnc-g71.ngc"), None),
];

fn config(system: Option<GCodeSystem>) -> PipelineConfig {
    let mut profile = MachineProfile::lathe();
    profile.language = match system {
        Some(_) => LanguageSettings { g_code_system: system, ..LanguageSettings::default() },
        None => LanguageSettings::linuxcnc(),
    };
    // One program is of a Haas lathe, whose words differ from FANUC's in one line only.
    profile.language.drilling.style = DrillingStyle::Haas;
    profile.language.turning.groove_return_mm = Some(0.5);
    let mut config = PipelineConfig::new(profile);
    let nose = |number: u32| ToolOffset { tip: 3, ..ToolOffset::new(number).with_radius(0.4) };
    config.tools = (1..=10).map(|number| Tool { number, offset: nose(number), ..Tool::default() }).collect();
    config
}

#[test]
fn programs_of_posts_are_accepted() {
    for (name, program, system) in PROGRAMS {
        let report = validate(program, &config(system));
        let findings: Vec<_> = report
            .findings
            .iter()
            .filter(|finding| finding.severity != feedwave_program::Severity::Info)
            .map(|finding| format!("{} {}: {}", finding.span.line, finding.code, finding.message))
            .collect();
        assert!(report.is_accepted(), "{name}: {findings:#?}");
        assert!(report.summary.setpoint_count > 1_000, "{name}");
    }
}

#[test]
fn a_stream_resumes_inside_cycles() {
    for (name, program, system) in
        PROGRAMS.into_iter().filter(|(name, ..)| matches!(*name, "pockets-type-2" | "linuxcnc-g71"))
    {
        let config = config(system);
        let whole = all_bits(&run(program, &config));
        let taken = snapshots(program.as_bytes(), &config);
        assert!(taken.len() >= 4, "{name}: {}", taken.len());
        for (index, offset, snapshot) in taken {
            let (first, rest) = resume(program.as_bytes(), &config, offset, &snapshot);
            assert_eq!(first, index);
            assert!(all_bits(&rest) == whole[index as usize..], "{name} from {index}");
        }
        assert!(all_bits(&run_in_pieces(program.as_bytes(), &config, 7)) == whole, "{name}");
    }
}
