//! Programs that jump, loop and call: resumed anywhere, cut into any pieces, looked ahead in, they give the same setpoints.

use crate::common::{all_bits, resume, run, run_in_pieces, snapshots, validate};
use feedwave_cutting::{MachineProfile, PipelineConfig};
use feedwave_program::LanguageSettings;

/// A pattern of pockets by loops within a subprogram, called from a loop, with a jump back and a macro behind every move.
const MACRO_B: &str = "\
#100=1
WHILE [#100 LE 4] DO1
G65 P9000 X[#100*6.] Y[#100*2.] D1.5
#100=#100+1
END1
N10 G1 X[#100*2.] Y0 F900
#100=#100-1
IF [#100 GT 0] GOTO 10
M98 P9100 L3
M30
O9000 (POCKET)
G0 X#24 Y#25
#1=0
WHILE [#1 LT 6] DO1
G1 X[#24+#7*COS[#1*60]] Y[#25+#7*SIN[#1*60]] F1200
#1=#1+1
END1
M99
O9100
G91
G1 X1. Y-0.5 F1000
G90
M99
";

const O_WORDS: &str = "\
G21 G17 G90 G64 P0.01
o100 sub
  #5=0
  o101 while [#5 LT 30]
    G1 X[#1+SIN[#5*12]*#2] Y[COS[#5*12]*#2] F1500
    #5=[#5+1]
  o101 endwhile
o100 endsub [#1]
#7=1
o200 do
  o100 call [#7*3] [2+#7]
  o201 if [#<_value> GT 6]
    G0 Z[#<_value>]
  o201 else
    G1 Z-1
  o201 endif
  #7=[#7+1]
o200 while [#7 LT 5]
o300 repeat [3]
  G91 G1 X2
  G90
o300 endrepeat
M2
";

fn configs() -> [(&'static str, PipelineConfig); 2] {
    let mill = PipelineConfig::new(MachineProfile::mill());
    let profile = MachineProfile { language: LanguageSettings::linuxcnc(), ..MachineProfile::mill() };
    [(MACRO_B, mill), (O_WORDS, PipelineConfig::new(profile))]
}

#[test]
fn pieces_of_any_size_give_the_same_setpoints() {
    for (program, config) in configs() {
        let whole = run(program, &config);
        assert!(whole.len() > 1_000, "{}", whole.len());
        for piece in [1, 7, 100] {
            assert_eq!(all_bits(&run_in_pieces(program.as_bytes(), &config, piece)), all_bits(&whole), "{piece}");
        }
        let report = validate(program, &config);
        assert!(report.is_accepted(), "{:#?}", report.findings);
        assert_eq!(report.summary.setpoint_count, whole.len() as u64);
    }
}

#[test]
fn a_stream_resumes_inside_loops_and_calls() {
    for (program, config) in configs() {
        let whole = all_bits(&run(program, &config));
        let taken = snapshots(program.as_bytes(), &config);
        assert!(taken.len() >= 2, "{}", taken.len());
        for (index, offset, snapshot) in taken {
            let (first, rest) = resume(program.as_bytes(), &config, offset, &snapshot);
            assert_eq!(first, index);
            assert_eq!(all_bits(&rest), whole[index as usize..], "from {index}");
        }
    }
}

/// Longer than the pages that are kept: bytes are asked for again.
#[test]
fn a_loop_around_a_long_program_reads_it_again() {
    let filler = "(nothing of note happens on this line of the program)\n".repeat(60_000);
    let program = format!("#1=0\nN1 G1 X[#1*3.] F3000\n{filler}#1=#1+1\nIF [#1 LT 4] GOTO 1\nM30\n");
    let config = PipelineConfig::new(MachineProfile::mill());
    let short = program.replace(&filler, "");
    let mut expected = run(&short, &config);
    let found = run_in_pieces(program.as_bytes(), &config, 100_000);
    expected.line.clear();
    assert_eq!(found.axes, expected.axes);
}
