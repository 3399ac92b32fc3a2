//! Where polar words of LinuxCNC lead: `@` and `^`.

use super::super::execute::Execution;
use crate::block::PolarWords;
use crate::code;
use crate::coordinates::direction;
use crate::{Finding, Position};

impl Execution<'_> {
    /// Places X and Y of `end`, which has the position that they start from: the origin is that of the coordinates in force, and X a
    /// radius. Under `G91` both words add to those of the start.
    #[cold]
    pub(in crate::interpreter) fn place_polar(&mut self, words: &PolarWords, end: &mut Position) {
        let [x, y] = [end[0], end[1]];
        let is_at_origin = x == 0.0 && y == 0.0;
        let radius = words.radius.map(|word| self.scaled(&word, true));
        let angle = words.angle.map(|word| word.number.value());
        if is_at_origin && (!self.state.absolute || angle.is_none()) {
            let message = match self.state.absolute {
                true => "@ at the origin, where no angle is in force",
                false => "incremental polar words at the origin, where no angle is in force",
            };
            let span = self.block.span();
            return self.findings.push_with(code::POLAR_WORD, |code| {
                Finding::new(code, span, message).suggest("write @ and ^ under G90")
            });
        }
        let (start_mm, start_deg) = (libm::hypot(x, y), libm::atan2(y, x).to_degrees());
        let (radius_mm, angle_deg) = match self.state.absolute {
            true => (radius.unwrap_or(start_mm), angle.unwrap_or(start_deg)),
            false => (start_mm + radius.unwrap_or(0.0), start_deg + angle.unwrap_or(0.0)),
        };
        let [cosine, sine] = direction(angle_deg);
        (end[0], end[1]) = (radius_mm * cosine, radius_mm * sine);
    }
}
