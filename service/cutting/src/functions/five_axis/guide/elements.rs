//! Elements of the machine axes for a guided block, with the turns of the first rotary axis in a pole.

use feedwave_motion::kinematics::vector::{angle, unit};
use feedwave_motion::kinematics::{FiveAxisBlock, FiveAxisMotion, FiveAxisPoint, FiveAxisRefusal, Setup, Toward};

use super::{Guide, POLE_RAD};

/// Rotary values closer than this are the same solution, rad.
const SAME_SOLUTION_RAD: f64 = 1e-6;

impl Guide {
    /// The elements of a block. Where it tilts the tool away from a pole, in which the first rotary axis is free, that axis
    /// turns first to the solution that was chosen for what follows, or else that the profile prefers among those within the
    /// ranges. A rapid to another solution than that at hand turns both axes evenly.
    pub(super) fn elements(
        &self,
        setup: &Setup,
        start: &FiveAxisPoint,
        block: &FiveAxisBlock<'_>,
        chosen_rad: Option<[f64; 2]>,
    ) -> Result<FiveAxisMotion, FiveAxisRefusal> {
        let Some(angles) = self.turn_in_pole(setup, start, block, chosen_rad) else {
            let motion = self.kinematics.elements(setup, start, block);
            let (Some(chosen_rad), true, Toward::Vector(target)) = (chosen_rad, block.rapid, block.toward) else {
                return motion;
            };
            let is_there = |motion: &FiveAxisMotion| {
                let end_rad = self.kinematics.from_position(&motion.end.position).rotary_rad;
                end_rad.iter().zip(chosen_rad).all(|(end, chosen)| (end - chosen).abs() <= SAME_SOLUTION_RAD)
            };
            // The program has to state in which direction to turn to the opposite one.
            if matches!(motion, Err(FiveAxisRefusal::Opposite(_))) || motion.as_ref().is_ok_and(is_there) {
                return motion;
            }
            let block = FiveAxisBlock { toward: self.approached(chosen_rad.map(f64::to_degrees), start), ..*block };
            let motion = self.kinematics.elements(setup, start, &block)?;
            let direction = unit(target).unwrap_or(motion.end.direction);
            return Ok(FiveAxisMotion { end: FiveAxisPoint { direction, ..motion.end }, ..motion });
        };
        let toward = self.approached(angles, start);
        let turn = FiveAxisBlock { end_mm: start.tip_mm, curve: None, toward, ..*block };
        let turn = self.kinematics.elements(setup, start, &turn)?;
        let (stood, start) = (start, FiveAxisPoint { direction: start.direction, ..turn.end });
        let motion = self.kinematics.elements(setup, &start, block)?;
        let place = self.kinematics.letters().1[0].index();
        let turn_in_pole_rad = (turn.end.position[place] - stood.position[place]).abs().to_radians();
        let elements = turn.elements.into_iter().chain(motion.elements).collect();
        Ok(FiveAxisMotion { elements, turn_in_pole_rad: motion.turn_in_pole_rad.max(turn_in_pole_rad), ..motion })
    }

    /// Rotary angles, degrees, as those of them that are nearest.
    fn approached(&self, angles_deg: [f64; 2], start: &FiveAxisPoint) -> Toward {
        let from_deg = self.kinematics.letters().1.map(|axis| start.position[axis.index()]);
        Toward::Angles([0, 1].map(|axis| self.kinematics.approach_deg(axis, angles_deg[axis], from_deg[axis])))
    }

    /// Rotary angles, degrees, to turn to before a block that leaves a pole; nothing where there is nothing to turn.
    fn turn_in_pole(
        &self,
        setup: &Setup,
        start: &FiveAxisPoint,
        block: &FiveAxisBlock<'_>,
        chosen_rad: Option<[f64; 2]>,
    ) -> Option<[f64; 2]> {
        let Toward::Vector(target) = block.toward else { return None };
        let stand_rad = self.kinematics.from_position(&start.position).rotary_rad;
        if self.kinematics.pole_distance_rad(stand_rad) > POLE_RAD {
            return None;
        }
        let target = unit(target).filter(|&target| angle(target, start.direction) > POLE_RAD)?;
        let start_rad = match chosen_rad {
            Some(chosen_rad) => chosen_rad,
            None => {
                let chosen = self.kinematics.choose_start([target], setup, stand_rad).ok()?;
                if chosen.singular == 0 { chosen.start_rad } else { stand_rad }
            }
        };
        ((start_rad[0] - stand_rad[0]).abs() > POLE_RAD).then(|| [start_rad[0].to_degrees(), stand_rad[1].to_degrees()])
    }
}
