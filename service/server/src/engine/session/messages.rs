//! What a machine sends during a run, read from the contract: columns of telemetry, events, answers to decisions.

use feedwave_contract::convert::spindle_answer_from_proto;
use feedwave_contract::proto;
use feedwave_monitoring::{Batch, BatchError, Event, Pair, SpindleAnswer};
use proto::machine_event::Event as ProtoEvent;

use super::{MAX_BATCH_EVENTS, MAX_BATCH_SAMPLES};
use crate::error::{Error, Result};

/// Most characters of the note of an answer to a decision.
const MAX_ANSWER_NOTE_CHARACTERS: usize = 500;

/// Refuses a batch with more samples or events than a batch may have.
pub(super) fn check_size(batch: &proto::TelemetryBatch) -> Result<()> {
    for (field, size, limit) in [
        ("batch.time_ns", batch.time_ns.len(), MAX_BATCH_SAMPLES),
        ("batch.events", batch.events.len(), MAX_BATCH_EVENTS),
    ] {
        if size > limit {
            return Err(Error::invalid(field, format!("has {size} entries, more than the {limit} allowed")));
        }
    }
    Ok(())
}

/// The columns of a batch, as they came.
pub(super) fn columns(batch: &proto::TelemetryBatch) -> Batch<'_> {
    // What one sensor of a pair delivered says nothing without the other.
    fn pair(pair: &Option<proto::ChannelPair>) -> Option<Pair<'_>> {
        let delivered = pair.as_ref().filter(|pair| !pair.x.is_empty() && !pair.y.is_empty());
        delivered.map(|pair| Pair { x: &pair.x, y: &pair.y })
    }
    fn column<T>(values: &[T]) -> Option<&[T]> {
        Some(values).filter(|values| !values.is_empty())
    }
    Batch {
        sequence: batch.sequence,
        time_ns: &batch.time_ns,
        tool: pair(&batch.tool),
        work: pair(&batch.work),
        commanded: pair(&batch.commanded),
        velocity_mm_per_s: pair(&batch.velocity),
        spindle_angle_deg: column(&batch.spindle_angle_deg),
        spindle_rev_per_min: column(&batch.spindle_rev_per_min),
        contact: column(&batch.contact),
        line: column(&batch.line),
    }
}

/// What is wrong with the columns of a batch, by the field of the contract.
pub(super) fn batch_error(error: &BatchError) -> Error {
    let field = match error {
        BatchError::ColumnLength { column, .. } => format!("batch.{column}"),
        BatchError::TooLarge { .. } => "batch.time_ns".to_owned(),
    };
    Error::invalid(field, error.to_string())
}

/// The event of a batch at `index`; a live run sets overrides and resumes by itself, so that those are refused there.
pub(super) fn event_from_proto(index: usize, event: &proto::MachineEvent, live: bool) -> Result<Event> {
    let invalid = |part: &str, why: &str| Err(Error::invalid(format!("batch.events[{index}].{part}"), why));
    match &event.event {
        None => invalid("event", "must be set"),
        Some(ProtoEvent::Overrides(_)) if live => invalid("overrides", "a live run sets the overrides itself"),
        Some(ProtoEvent::Resume(_)) if live => invalid("resume", "a live run is resumed with a command"),
        Some(ProtoEvent::Resume(false)) => invalid("resume", "must be true"),
        Some(ProtoEvent::Resume(true)) => Ok(Event::Resume),
        Some(ProtoEvent::Rebaseline(false)) => invalid("rebaseline", "must be true"),
        Some(ProtoEvent::Rebaseline(true)) => Ok(Event::Rebaseline),
        Some(ProtoEvent::ProgrammedRevPerMin(rev_per_min)) => {
            Ok(Event::ProgrammedSpindle { rev_per_min: *rev_per_min })
        }
        Some(ProtoEvent::Overrides(overrides)) => {
            Ok(Event::Overrides { feed: overrides.feed, spindle: overrides.spindle })
        }
        Some(ProtoEvent::Threading(threading)) => Ok(Event::Threading(*threading)),
        Some(ProtoEvent::Tool(tool)) => Ok(Event::Tool(*tool)),
        Some(ProtoEvent::SpindleAnswer(answer)) => spindle_answer(answer)
            .map_err(|(part, why)| Error::invalid(format!("batch.events[{index}].spindle_answer.{part}"), why)),
    }
}

/// An answer to a decision on the spindle speed, or the field that is wrong and why.
fn spindle_answer(answer: &proto::SpindleAnswer) -> Result<Event, (&'static str, String)> {
    let proto::SpindleAnswer { decision_number, reached_ns, rev_per_min, note, .. } = answer;
    let read = spindle_answer_from_proto(answer.kind(), *reached_ns, *rev_per_min);
    let read = read.ok_or_else(|| ("kind", "must be accepted, reached or refused".to_owned()))?;
    let is_reached = matches!(read, SpindleAnswer::Reached { .. });
    for (part, is_set) in [("reached_ns", reached_ns.is_some()), ("rev_per_min", rev_per_min.is_some())] {
        if is_set && !is_reached {
            return Err((part, "must not be set where the speed is not reached".to_owned()));
        }
    }
    if let Some(rev_per_min) = rev_per_min.filter(|speed| !(speed.is_finite() && *speed > 0.0 && *speed <= 1e6)) {
        return Err(("rev_per_min", format!("must be above 0 and at most 1000000, is {rev_per_min}")));
    }
    let characters = note.chars().count();
    if characters > MAX_ANSWER_NOTE_CHARACTERS {
        return Err(("note", format!("must have at most {MAX_ANSWER_NOTE_CHARACTERS} characters, has {characters}")));
    }
    Ok(Event::SpindleAnswer { decision: *decision_number, answer: read })
}

/// What is to be remembered with the decision that an event makes.
pub(super) fn note_of(event: &proto::MachineEvent) -> Option<&str> {
    match &event.event {
        Some(ProtoEvent::SpindleAnswer(answer)) => Some(&answer.note),
        _ => None,
    }
}
