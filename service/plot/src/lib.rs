//! Pictures of a program and its setpoints, as SVG and PNG, without any system library.
//!
//! Invariant: memory does not grow with the program; what is left out is smaller than a pixel.

mod canvas;
mod clip;
mod draw;
mod dynamics;
mod figure;
mod five_axis;
mod layout;
mod lobes;
mod motion;
mod path_deviation;
mod path_vibration;
mod rapids;
mod robustness;
mod run;
mod series;
mod theme;
mod thread;
mod tool_oscillation;
mod tool_path;
mod trace;

use std::ops::Range;
use std::path::{Path, PathBuf};

use feedwave_cutting::SetpointBlock;

pub use canvas::PlotError;
use dynamics::{DynamicsPicture, PathDynamics};
use figure::Figure;
pub use five_axis::{FiveAxisPlots, FiveAxisSetup, ThinningShown};
pub use lobes::{LobesPicture, write_lobes};
use motion::{FeedPicture, MotionCurves, PositionPicture};
use path_deviation::PathDeviationPicture;
pub use path_deviation::{CloseView, PathDeviations};
use path_vibration::ChipPicture;
pub use path_vibration::Cut;
pub use rapids::RapidLines;
pub use robustness::{RobustnessPicture, write_robustness};
pub use run::{RunTrace, write_run};
pub use thread::{ThreadPictures, write_thread};
pub use tool_oscillation::{OscillationPictures, write_oscillation};
use tool_path::ToolPathPicture;
pub use trace::{PathTrace, Point, Stretch};

/// An axis of the machine, as pictures show it.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisShown {
    /// Its name in the setpoints.
    pub name: String,
    /// Whether its values are degrees rather than millimetres.
    pub rotary: bool,
    /// Largest velocity, mm/s or degrees/s.
    pub max_velocity_per_s: f64,
    /// Largest acceleration, mm/s² or degrees/s².
    pub max_acceleration_per_s2: f64,
    /// Largest jerk, mm/s³ or degrees/s³.
    pub max_jerk_per_s3: f64,
}

/// Collects what the pictures of one program show, and draws them.
#[derive(Clone, Debug)]
pub struct Plots {
    program: String,
    turning: bool,
    axes: Vec<AxisShown>,
    axes_are_the_machines: bool,
    trace: PathTrace,
    rapids: RapidLines,
    curves: MotionCurves,
    dynamics: PathDynamics,
    chips: Vec<ChipPicture>,
    deviations: Option<PathDeviations>,
    five_axis: Option<FiveAxisPlots>,
}

impl Plots {
    /// Pictures of a program on a machine with these axes; `turning` draws the tool path like a lathe. Commands come
    /// every `command_period_s`, setpoints every `period_s`: the same, but where the drives refine the commands.
    #[must_use]
    pub fn new(
        program: impl Into<String>,
        turning: bool,
        axes: Vec<AxisShown>,
        command_period_s: f64,
        period_s: f64,
    ) -> Self {
        Self {
            program: program.into(),
            turning,
            trace: PathTrace::default(),
            rapids: RapidLines::default(),
            curves: MotionCurves::new(&axes, period_s),
            dynamics: PathDynamics::new(&axes, command_period_s),
            axes,
            axes_are_the_machines: true,
            chips: Vec::new(),
            deviations: None,
            five_axis: None,
        }
    }

    /// The tool path and the lines that move rapidly. Call before setpoints and commands are pushed.
    pub fn set_path(&mut self, trace: PathTrace, rapids: RapidLines) {
        (self.trace, self.rapids) = (trace, rapids);
    }

    /// Adds a picture of the path as programmed and as run.
    pub fn set_deviations(&mut self, deviations: PathDeviations) {
        self.deviations = Some(deviations);
    }

    /// Says that the setpoints are in the coordinates of the work, which the axes of the machine are not.
    pub const fn show_the_work(&mut self) {
        self.axes_are_the_machines = false;
    }

    /// Says that what is superposed on the path is a tool oscillation.
    pub const fn oscillate(&mut self) {
        self.curves.oscillate();
    }

    /// Adds a close view of a few vibration periods. Call before the setpoints are pushed.
    pub fn add_window(&mut self, title: impl Into<String>, time_s: Range<f64>) {
        self.curves.add_window(title, time_s);
    }

    /// Adds a picture of the chip: the programmed cut and, where there is one, the suggested cut beside it.
    pub fn add_chip(&mut self, name: impl Into<String>, subtitle: impl Into<String>, cuts: Vec<Cut>) {
        self.chips.push(ChipPicture { name: name.into(), subtitle: subtitle.into(), cuts });
    }

    /// Adds the pictures of a five-axis program. Call before commands are pushed.
    pub fn set_five_axis(&mut self, pictures: FiveAxisPlots) {
        self.five_axis = Some(pictures);
    }

    /// Marks a change of the feed override; changes come in the order of time.
    pub fn add_override(&mut self, time_s: f64, ratio: f64) {
        self.dynamics.add_override(time_s, ratio);
    }

    /// Takes in a block of commands; blocks come in order.
    pub fn push_commands(&mut self, block: &SetpointBlock) {
        self.dynamics.push(block, &self.rapids);
        if let Some(pictures) = &mut self.five_axis {
            pictures.push(block);
        }
    }

    /// Takes in a block of setpoints; blocks come in order.
    pub fn push(&mut self, block: &SetpointBlock) {
        self.curves.push(block, &self.rapids);
    }

    /// Draws everything into the directory, which is created where it is missing.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, directory: &Path) -> Result<Vec<PathBuf>, PlotError> {
        canvas::make(directory)?;
        let figures = self.figures();
        let mut files = Vec::with_capacity(2 * figures.len());
        for figure in &figures {
            files.extend(canvas::write(figure, directory)?);
        }
        Ok(files)
    }

    /// Every picture, as data.
    fn figures(&self) -> Vec<Figure> {
        let (program, turning, trace, curves) = (self.program.as_str(), self.turning, &self.trace, &self.curves);
        let (dynamics, axes, axes_are_the_machines) =
            (&self.dynamics, self.axes.as_slice(), self.axes_are_the_machines);
        let mut figures = vec![
            ToolPathPicture { program, trace, turning }.figure(),
            PositionPicture { program, curves }.figure(),
            FeedPicture { program, curves }.figure(),
            DynamicsPicture { program, dynamics, curves, axes, axes_are_the_machines }.figure(),
        ];
        if let Some(deviations) = &self.deviations {
            figures.insert(1, PathDeviationPicture { program, deviations, turning }.figure());
        }
        figures.extend(self.chips.iter().map(ChipPicture::figure));
        if let Some(pictures) = &self.five_axis {
            figures.extend(pictures.figures(program));
        }
        figures
    }
}

#[cfg(test)]
mod tests;
