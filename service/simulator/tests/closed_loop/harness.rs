//! A live run: the pipeline's setpoints move the machine, its telemetry is judged, decisions change what the pipeline
//! plans.

use feedwave_cutting::{MachineProfile, OverrideChange, Pipeline, PipelineConfig, SetpointBlock, Step};
use feedwave_monitoring::{
    Action, Batch, Decision, Event, Evidence, Length, Monitor, MonitoringConfig, Pair, Properties, Reason, SpikeFilter,
};
use feedwave_simulator::{Contact, Description, Setpoints, Simulator, Where};
use std::sync::Arc;

/// Setpoints handed out at once: what a client has in its buffer.
const AHEAD: usize = 20;

/// One slot of 120 mm along X at 20 mm/s and 3000 rev/min; line 3 cuts.
pub const SLOT: &str = "G21 G90 G94 G17 S3000 M3\nG0 X10 Y0 Z0\nG1 X130 F1200\nG0 X140\nM30\n";
pub const SLOT_REV_PER_MIN: f64 = 3000.0;

pub fn line(line: u32, depth_mm: f64) -> Vec<Contact> {
    vec![Contact { at: Where::Lines { first: line, last: line }, depth_mm }]
}

/// The default mill, cutting this deep in line 3.
pub fn mill(depth_mm: f64) -> Description {
    Description { seed: 7, contacts: line(3, depth_mm), ..Description::default() }
}

/// Windows of 0.2 s at 20 kHz after 0.1 s of settling, default limits, p = 5 %.
pub fn judging() -> MonitoringConfig {
    let mut config = MonitoringConfig {
        sample_rate_hz: 20_000.0,
        settling_s: 0.1,
        window: Length::Seconds(0.2),
        baseline: Length::Series(3),
        ..MonitoringConfig::default()
    };
    config.quality.spikes = Some(SpikeFilter { max_step: 0.1, max_run: 3 });
    config.quality.min_valid_samples = 1000;
    config.quality.stuck_samples = 100;
    config.quality.silence_s = 0.05;
    config
}

/// One telemetry batch as it was logged.
#[derive(Debug, Clone)]
struct Stored {
    sequence: u64,
    time_ns: Vec<u64>,
    pairs: [Option<[Vec<f64>; 2]>; 3],
    angle_deg: Vec<f64>,
    rev_per_min: Vec<f64>,
    contact: Vec<bool>,
}

#[derive(Debug, Clone)]
enum Entry {
    Batch(Box<Stored>),
    Event(Event),
}

/// A run and its results.
pub struct Live {
    program: &'static str,
    config: PipelineConfig,
    pub machine: Simulator,
    pub monitor: Monitor,
    pub decisions: Vec<Decision>,
    /// Bits of every setpoint.
    pub setpoints: Vec<Vec<u64>>,
    /// Time, true peak deflection, and feed in force, block by block.
    pub truth: Vec<(u64, f64, f64)>,
    log: Vec<Entry>,
}

/// Runs a program on a mill with 0.2 s of idling before, to its end or to where an escalation holds the feed.
pub fn run(program: &'static str, rev_per_min: f64, description: Description, monitoring: MonitoringConfig) -> Live {
    run_on(MachineProfile::mill(), program, rev_per_min, description, monitoring)
}

pub fn run_on(
    profile: MachineProfile,
    program: &'static str,
    rev_per_min: f64,
    description: Description,
    monitoring: MonitoringConfig,
) -> Live {
    let mut live = Live {
        program,
        config: PipelineConfig::new(profile),
        machine: Simulator::new(description).unwrap_or_else(|violations| panic!("{violations:?}")),
        monitor: Monitor::new(monitoring).unwrap_or_else(|violations| panic!("{violations:?}")),
        decisions: Vec::new(),
        setpoints: Vec::new(),
        truth: Vec::new(),
        log: Vec::new(),
    };
    live.note(Event::ProgrammedSpindle { rev_per_min });
    live.listen(|machine, sink| machine.idle(0.2, rev_per_min, sink).unwrap());
    live.follow();
    live
}

impl Live {
    /// Lets the machine move and judges what it sends.
    fn listen(&mut self, moves: impl FnOnce(&mut Simulator, &mut dyn FnMut(&Batch<'_>))) {
        let Self { machine, monitor, decisions, log, .. } = self;
        moves(machine, &mut |batch| {
            log.push(Entry::Batch(Box::new(Stored::new(batch))));
            monitor.push(batch, &mut |decision| decisions.push(decision)).unwrap();
        });
        let clock = Event::Clock(self.machine.clock_ns());
        self.note(clock);
    }

    fn note(&mut self, event: Event) {
        self.log.push(Entry::Event(event));
        self.monitor.note(event, &mut |decision| self.decisions.push(decision)).unwrap();
    }

    /// Goes on after an escalation has held the feed.
    pub fn resume(&mut self) {
        self.note(Event::Resume);
        let ratio = self.monitor.overrides().feed;
        self.config.overrides.push(OverrideChange { index: self.setpoints.len() as u64, ratio });
        self.follow();
    }

    fn follow(&mut self) {
        let mut pipeline = self.planned_anew(self.setpoints.len() as u64);
        let mut block = pipeline.new_block();
        let mut obeyed = self.decisions.len();
        while next(&mut pipeline, &mut block, self.program, AHEAD) {
            (0..block.len()).for_each(|at| self.setpoints.push(bits(&block, at)));
            self.listen(|machine, sink| machine.push(&setpoints(&block), sink).unwrap());
            let feed = block.feed_mm_per_min[block.len() - 1];
            self.truth.push((self.machine.clock_ns(), self.machine.take_peak_deflection_mm(), feed));
            if self.monitor.holds_feed() && feed == 0.0 {
                break;
            }
            let changes = |decision: &&Decision| matches!(decision.outcome.action, Action::Change | Action::HoldFeed);
            let changed = self.decisions[obeyed..].iter().rfind(changes);
            obeyed = self.decisions.len();
            if let Some(after) = changed.map(|decision| decision.outcome.after) {
                self.machine.set_spindle_override(after.spindle).unwrap();
                let change = OverrideChange { index: pipeline.next_index(), ratio: after.feed };
                self.config.overrides.push(change);
                pipeline = self.planned_anew(pipeline.next_index());
            }
        }
        self.listen(|machine, sink| machine.flush(sink));
    }

    /// The pipeline that has had all changes from the start, at a setpoint.
    fn planned_anew(&self, index: u64) -> Pipeline {
        let mut pipeline = Pipeline::new(Arc::new(self.config.clone()));
        let mut block = pipeline.new_block();
        while pipeline.next_index() < index {
            let most = (index - pipeline.next_index()) as usize;
            assert!(next(&mut pipeline, &mut block, self.program, most));
        }
        pipeline
    }

    pub fn reasons(&self) -> Vec<Reason> {
        self.decisions.iter().map(|decision| decision.outcome.reason).collect()
    }

    pub fn changes(&self) -> usize {
        self.config.overrides.len()
    }

    /// Properties of the windows that were evidence, with the feed override they were cut under.
    pub fn windows(&self) -> impl Iterator<Item = (Properties, f64)> {
        self.decisions.iter().filter_map(|decision| match decision.inputs.evidence {
            Evidence::Process(properties) => Some((properties, decision.inputs.before.feed)),
            _ => None,
        })
    }

    /// The decisions that the logged telemetry and events give in a fresh monitor.
    pub fn replayed_decisions(&self) -> Vec<Decision> {
        let mut monitor = Monitor::new(self.monitor.config().clone()).unwrap();
        let mut decisions = Vec::new();
        for entry in &self.log {
            let mut sink = |decision| decisions.push(decision);
            match entry {
                Entry::Batch(stored) => monitor.push(&stored.batch(), &mut sink).map(|_| ()).unwrap(),
                Entry::Event(event) => monitor.note(*event, &mut sink).unwrap(),
            }
        }
        decisions
    }

    /// The setpoints of the program under the overrides of this run, all known from the start.
    pub fn replayed_setpoints(&self) -> Vec<Vec<u64>> {
        let mut pipeline = Pipeline::new(Arc::new(self.config.clone()));
        let mut block = pipeline.new_block();
        let mut replayed = Vec::new();
        while next(&mut pipeline, &mut block, self.program, usize::MAX) {
            (0..block.len()).for_each(|at| replayed.push(bits(&block, at)));
        }
        replayed
    }
}

impl Stored {
    fn new(batch: &Batch<'_>) -> Self {
        let pair = |pair: Option<Pair<'_>>| pair.map(|pair| [pair.x.to_vec(), pair.y.to_vec()]);
        Self {
            sequence: batch.sequence,
            time_ns: batch.time_ns.to_vec(),
            pairs: [batch.tool, batch.work, batch.commanded].map(pair),
            angle_deg: batch.spindle_angle_deg.unwrap().to_vec(),
            rev_per_min: batch.spindle_rev_per_min.unwrap().to_vec(),
            contact: batch.contact.unwrap().to_vec(),
        }
    }

    fn batch(&self) -> Batch<'_> {
        let [tool, work, commanded] = [0, 1, 2].map(|at| self.pairs[at].as_ref().map(|[x, y]| Pair { x, y }));
        Batch {
            sequence: self.sequence,
            time_ns: &self.time_ns,
            tool,
            work,
            commanded,
            spindle_angle_deg: Some(&self.angle_deg),
            spindle_rev_per_min: Some(&self.rev_per_min),
            contact: Some(&self.contact),
            ..Batch::default()
        }
    }
}

/// The next block; `false` at the program's end.
fn next(pipeline: &mut Pipeline, block: &mut SetpointBlock, program: &str, most: usize) -> bool {
    loop {
        match pipeline.next_setpoints(block, most) {
            Step::Block => return true,
            Step::Finished => return false,
            Step::Refused => panic!("refused: {:#?}", pipeline.findings()),
            Step::NeedInput(place) => pipeline.supply(place, program.as_bytes()),
        }
    }
}

fn setpoints(block: &SetpointBlock) -> Setpoints<'_> {
    Setpoints {
        first_index: block.first_index,
        axes_mm: Some([&block.axes[0], &block.axes[1]]),
        path_position_mm: &block.path_position_mm,
        feed_mm_per_min: &block.feed_mm_per_min,
        spindle_angle_deg: &block.spindle_angle_deg,
        line: &block.line,
    }
}

fn bits(block: &SetpointBlock, at: usize) -> Vec<u64> {
    let columns = block.axes.iter().chain([&block.path_position_mm, &block.feed_mm_per_min, &block.spindle_angle_deg]);
    columns.map(|column| column[at].to_bits()).chain([u64::from(block.line[at])]).collect()
}
