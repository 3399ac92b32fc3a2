//! Radius compensation in a tilted plane, and where tool centre point control or a plane has left axes that only the machine knows:
//! where a contour can begin, and what would give it other coordinates.

use super::super::execute::Execution;
use crate::code;
use crate::compensation::LEAVE_FIRST;
use crate::dialect::Meaning;
use crate::state::{ToolControl, ToolMode};
use crate::{AxisSet, Compensator, Finding, SourceSpan};

impl Execution<'_> {
    /// Whether no contour can begin while a tool is guided or axes are held, which is then reported; where the plane itself was
    /// refused, that has been said.
    #[cold]
    pub(super) fn is_contour_refused(&mut self, span: SourceSpan) -> bool {
        let ToolControl { mode, held, is_aligned, .. } = self.state.tool_control;
        match mode {
            ToolMode::Plane if self.state.is_plane_refused() => {}
            ToolMode::Angles | ToolMode::Vectors => self.contour_of_guided_tool(span),
            ToolMode::Plane if !is_aligned => self.contour_beside_normal(span),
            ToolMode::Off | ToolMode::Plane if held.meets(AxisSet::LINEAR) => self.contour_from_held(span),
            ToolMode::Off | ToolMode::Plane => return false,
        }
        true
    }

    /// What controls have for it is three-dimensional compensation, by the direction of the tool.
    fn contour_of_guided_tool(&mut self, span: SourceSpan) {
        let ToolControl { on_line, length_offset, .. } = self.state.tool_control;
        self.findings.push_with(code::COMP_BLOCK, |code| {
            let message =
                format!("radius compensation under tool centre point control, which is on since line {on_line}");
            let cure = format!(
                "switch tool centre point control off with G49, call the length with G43 H{length_offset} and place X, Y and Z with \
                 G0, all before it"
            );
            Finding::new(code, span, message)
                .with_value("on_line", f64::from(on_line), "")
                .suggest("write the path of the tool's centre, without G41, G42 and G40")
                .suggest(cure)
        });
    }

    fn contour_beside_normal(&mut self, span: SourceSpan) {
        let on_line = self.state.tool_control.on_line;
        self.findings.push_with(code::COMP_PLANE, |code| {
            let message = format!(
                "radius compensation in the tilted plane of line {on_line}, onto whose normal the tool axis is not turned"
            );
            Finding::new(code, span, message)
                .with_value("plane_line", f64::from(on_line), "")
                .suggest("turn the tool axis with G53.1 in a block before it, and place X, Y and Z with G0 behind that")
        });
    }

    fn contour_from_held(&mut self, span: SourceSpan) {
        self.findings.push_with(code::TOOL_CONTROL_HELD, |code| {
            let message = "a compensated contour from a place that the program does not know: the coordinates have changed \
                           with the tool centre point control or a tilted plane";
            Finding::new(code, span, message).suggest("place X, Y and Z with G0 before it")
        });
    }

    /// Whether a contour is on, or the tool may still stand beside one behind `G40`.
    pub(in super::super) const fn is_on_contour(&self) -> bool {
        self.state.compensation.on.is_some() || !self.state.compensator.is_off()
    }

    /// Whether a block gives other coordinates to a contour that is on, or beside which the tool still stands: this is then reported,
    /// and the contour ends there, so that what follows is judged on its own.
    #[cold]
    pub(in super::super) fn ends_contour(&mut self, span: SourceSpan, what: &'static str) -> bool {
        match self.state.compensation.on.take() {
            Some(on) if on.line == span.line => self.findings.push_with(code::COMP_BLOCK, |code| {
                let message = format!("{what} in the block that switches the radius compensation on");
                Finding::new(code, span, message).suggest("write it in a block before")
            }),
            Some(on) => self.compensation_refused(span, what, on.line),
            None if self.state.compensator.is_off() => return false,
            None => self.findings.push_with(code::COMP_BLOCK, |code| {
                let message = format!("{what} while the tool still stands beside the contour, behind G40");
                Finding::new(code, span, message).suggest(LEAVE_FIRST)
            }),
        }
        self.state.compensator = Compensator::default();
        true
    }

    /// What a tilted plane does not permit either: that finding says how both are left.
    pub(super) const fn is_refused_in_plane(&self, meaning: Meaning) -> bool {
        matches!(self.state.tool_control.mode, ToolMode::Plane)
            && matches!(
                meaning,
                Meaning::WorkOffset(_)
                    | Meaning::HaasWorkOffset(_)
                    | Meaning::ExtendedWorkOffset { .. }
                    | Meaning::ToolChange
                    | Meaning::ToolControl { .. }
            )
    }
}
