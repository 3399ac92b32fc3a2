//! Checks of every move by the state of the program: tool, spindle speed and feed.

use feedwave_motion::{Element, MOST_BYTES_WITHIN_REACH, MOST_WITHIN_REACH, Stretches};
use feedwave_program::{DialectName, Finding, FindingLog, MachineCommand, SourceSpan, Spindle, SpindleSpeed};

use super::Builder;
use crate::code;
use crate::frame::config::PipelineConfig;
use crate::shared::checks::{MAX_BLOCK_DURATION_S, is_rotary_only, too_long};

/// Different tools listed; a program can name a billion.
const MAX_LISTED_TOOLS: usize = 1_000;

/// More of the path lies within reach of a vibration than is held at once.
pub(crate) fn blocks_too_short(span: SourceSpan, blocks: usize) -> Finding {
    let within = "within one amplitude, or one blend of an oscillation, of the tool";
    let (message, value) = if blocks > MOST_WITHIN_REACH {
        (format!("more than {MOST_WITHIN_REACH} blocks lie {within}"), ("limit", MOST_WITHIN_REACH as f64))
    } else {
        // Curves of many points: fewer blocks, which take as much.
        let megabytes = MOST_BYTES_WITHIN_REACH >> 20;
        (format!("{blocks} blocks lie {within}, and take more than {megabytes} MiB"), ("blocks", blocks as f64))
    };
    Finding::new(code::VIB_BLOCKS_TOO_SHORT, span, message)
        .with_value(value.0, value.1, "")
        .suggest("use a smaller amplitude, or longer blocks")
}

impl Builder {
    pub(super) fn tool(&mut self, number: u32, span: SourceSpan, config: &PipelineConfig, findings: &mut FindingLog) {
        if let Some(analysis) = &mut self.analysis
            && analysis.tools.len() < MAX_LISTED_TOOLS
        {
            analysis.tools.insert(number);
        }
        self.state.speed_limit_reported = false;
        if number != 0 && !config.tools.is_empty() && !config.tools.iter().any(|tool| tool.number == number) {
            let known: Vec<String> = config.tools.iter().map(|tool| format!("T{}", tool.number)).collect();
            findings.push(
                Finding::new(code::TOOL_UNKNOWN, span, format!("tool {number} is not among the job's tools"))
                    .with_value("tool", f64::from(number), "")
                    .suggest(format!("the job has {}", known.join(", "))),
            );
        }
    }

    /// Spindle speed against the machine's and the tool's limit; once per tool. Constant surface speed is judged at the radius
    /// where it is highest.
    pub(super) fn check_speed(
        &mut self,
        (spindle, radius_mm): (&Spindle, f64),
        tool: u32,
        span: SourceSpan,
        config: &PipelineConfig,
        findings: &mut FindingLog,
    ) {
        if self.state.speed_limit_reported {
            return;
        }
        let tool_limit = config
            .tools
            .iter()
            .find(|listed| listed.number == tool)
            .and_then(|tool| tool.max_rev_per_min)
            .unwrap_or(f64::INFINITY);
        let machine_limit = config.profile.machine.max_spindle_rev_per_min;
        let limit = tool_limit.min(machine_limit);
        let (rev_per_min, message, cure) = match spindle.speed {
            // What the program insists on.
            SpindleSpeed::Constant { rev_per_min } => (
                rev_per_min,
                format!("spindle speed {rev_per_min} rev/min exceeds the limit of {limit} rev/min"),
                format!("program S{limit}"),
            ),
            // Clamped by the program and by the machine, which does not know the tool.
            SpindleSpeed::Surface { .. } => {
                let rev_per_min = spindle.rev_per_min(radius_mm).min(machine_limit);
                let message = format!(
                    "constant surface speed turns the spindle at up to {rev_per_min:.0} rev/min here, above the tool's limit \
                     of {limit} rev/min"
                );
                let cure = format!("clamp the speed at {limit} rev/min (G50 S or G92 S, in LinuxCNC D of G96)");
                (rev_per_min, message, cure)
            }
        };
        if spindle.is_turning() && rev_per_min > limit {
            self.state.speed_limit_reported = true;
            findings.push(
                Finding::new(code::SPINDLE_SPEED, span, message)
                    .with_value("spindle_speed", rev_per_min, "rev/min")
                    .with_value("limit", limit, "rev/min")
                    // The block that turns with it is found, which is not where the speed stands: no text of it is replaced.
                    .suggest_value(cure, None, "spindle_speed", limit, "rev/min"),
            );
        }
    }

    /// Whether an M code forbids feed overrides or allows them again: `M49` and `M48`, in LinuxCNC `M50` as well.
    pub(super) fn switch_override(&mut self, command: &MachineCommand, span: SourceSpan, config: &PipelineConfig) {
        let is_linuxcnc = config.profile.language.dialect == DialectName::LinuxCnc;
        let is_mill = config.profile.language.dialect == DialectName::Mill;
        let p = command.words.iter().find(|word| word.letter == 'P').map(|word| word.value);
        self.state.override_forbidden = match command.number {
            48 if is_linuxcnc || is_mill => None,
            49 if is_linuxcnc || is_mill => Some(span),
            50 if is_linuxcnc => (p == Some(0.0)).then_some(span),
            _ => return,
        };
    }

    /// A cut where the program forbids feed overrides; once per place that forbids them.
    pub(super) fn check_override(&mut self, config: &PipelineConfig, findings: &mut FindingLog) {
        let Some(span) = self.state.override_forbidden.take() else { return };
        // A hold is no change of the feed, and no code here forbids it.
        let planned = config.overrides.iter().map(|change| change.ratio).find(|ratio| *ratio != 0.0 && *ratio != 1.0);
        let finding = match planned {
            Some(ratio) => {
                let percent = 100.0 * ratio;
                let message = format!(
                    "the program forbids feed overrides from here on, but planned ones, such as {percent} %, act here as well"
                );
                Finding::new(code::OVERRIDE_FORBIDDEN, span, message)
                    .with_value("override", percent, "%")
                    .suggest("plan overrides that are back at 100 % where this block is run")
            }
            None => {
                let message = "the program forbids feed overrides from here on; those of a live run act all the same";
                Finding::new(code::OVERRIDE_FORBIDDEN_LIVE, span, message)
            }
        };
        findings.push(finding.suggest("take the code out where the feed may be changed"));
    }

    pub(super) fn check_feed(&mut self, stretches: &Stretches, element: &Element, findings: &mut FindingLog) {
        let span = element.source;
        let slowest = stretches.iter().map(|stretch| stretch.speed_mm_per_s).fold(f64::INFINITY, f64::min);
        let fastest = stretches.iter().map(|stretch| stretch.speed_mm_per_s).fold(0.0, f64::max);
        let duration_s = element.length / slowest;
        if !(0.0..=MAX_BLOCK_DURATION_S).contains(&duration_s) {
            findings.push(too_long(span, duration_s));
        }
        let limit = stretches.iter().map(|stretch| stretch.limits.velocity).fold(f64::INFINITY, f64::min);
        if fastest > limit && !self.state.feed_limited_reported {
            self.state.feed_limited_reported = true;
            let wanted = fastest * 60.0;
            let allowed = limit * 60.0;
            let unit = if is_rotary_only(element) { "deg/min" } else { "mm/min" };
            let message = format!(
                "the programmed feed {wanted:.1} {unit} is limited to {allowed:.1} {unit} by the axes here (first place)"
            );
            findings.push(
                Finding::new(code::FEED_LIMITED, span, message)
                    .with_value("feed", wanted, unit)
                    .with_value("limit", allowed, unit)
                    .suggest_value("program what the axes can follow", None, "feed", allowed, unit),
            );
        }
    }
}
