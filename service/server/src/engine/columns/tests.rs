use feedwave_contract::proto::ColumnKind as Kind;
use feedwave_contract::stream::{DEFAULT_CHUNK_BYTES, MAX_CHUNK_BYTES, MAX_CHUNK_SIZE};
use feedwave_contract::violations::Violations;
use feedwave_motion::Machine;

use super::*;

fn block(machine: &Machine, count: usize) -> SetpointBlock {
    let mut block = SetpointBlock::for_machine(machine, true);
    let ramp = |scale: f64| (0..count).map(|row| row as f64 * scale).collect::<Vec<_>>();
    for axis in &mut block.axes {
        *axis = ramp(0.5);
    }
    block.path_position_mm = ramp(1.0);
    block.feed_mm_per_min = ramp(2.0);
    block.vibration_offset_mm = ramp(3.0);
    block.spindle_angle_deg = ramp(4.0);
    block.line = (0..count).map(|row| row as u32 / 4).collect();
    if let Some(servo) = &mut block.servo {
        servo.frequency_hz = ramp(5.0);
        servo.phase_turns = ramp(6.0);
        for columns in [&mut servo.amplitude_mm, &mut servo.clamp_low_mm, &mut servo.clamp_high_mm] {
            for column in columns {
                *column = ramp(7.0);
            }
        }
    }
    block
}

fn select(wanted: &[Kind], conditions: bool, encoding: proto::Encoding) -> Result<ColumnSet, Violations> {
    let wanted: Vec<i32> = wanted.iter().map(|kind| i32::from(*kind)).collect();
    let mut violations = Violations::default();
    let set = ColumnSet::select(&mut violations, &wanted, &Machine::lathe(), conditions, false, encoding);
    if violations.is_empty() { Ok(set) } else { Err(violations) }
}

fn names(set: &ColumnSet) -> Vec<&str> {
    set.infos().iter().map(|info| info.name.as_str()).collect()
}

#[test]
fn without_a_wish_all_columns_are_sent_in_their_order() {
    let set = select(&[], false, proto::Encoding::PackedDouble).unwrap();
    let default = ["X_mm", "Z_mm", "path_position_mm", "feed_mm_per_min", "vibration_offset_mm", "spindle_angle_deg"];
    assert_eq!(names(&set), default);
    let with_conditions = select(&[], true, proto::Encoding::PackedDouble).unwrap();
    assert_eq!(names(&with_conditions)[..6], default);
    assert_eq!(names(&with_conditions).len(), 6 + 2 + 1 + 1 + 2 + 2);
}

#[test]
fn work_coordinates_of_a_five_axis_machine_have_the_tool_direction() {
    let mut violations = Violations::default();
    let encoding = proto::Encoding::PackedDouble;
    let set = ColumnSet::select(&mut violations, &[], &Machine::lathe(), false, true, encoding);
    assert!(violations.is_empty());
    assert_eq!(names(&set)[6..], ["tool_direction_X", "tool_direction_Y", "tool_direction_Z"]);
    let without = select(&[Kind::ToolDirection], false, encoding).unwrap_err();
    assert_eq!(without.as_slice()[0].field, "columns[0]");
}

#[test]
fn columns_that_the_stream_does_not_have_are_violations() {
    let violations =
        select(&[Kind::Feed, Kind::ServoPhase, Kind::Unspecified], false, proto::Encoding::PackedDouble).unwrap_err();
    let fields: Vec<_> = violations.as_slice().iter().map(|violation| violation.field.as_str()).collect();
    assert_eq!(fields, ["columns[1]", "columns[2]"]);
}

#[test]
fn chunks_cut_blocks_anywhere_and_lose_nothing() {
    let machine = Machine::lathe();
    let block = block(&machine, 20);
    for encoding in [proto::Encoding::PackedDouble, proto::Encoding::FixedPointDelta, proto::Encoding::RawDouble] {
        let set = select(&[Kind::Feed, Kind::AxisPosition], false, encoding).unwrap();
        let mut writer = ChunkWriter::new(&set, 7, 103);
        let mut chunks = Vec::new();
        assert!(writer.write(&block, 3..20, |chunk| {
            chunks.push(chunk);
            true
        }));
        chunks.extend(writer.finish());
        let counts: Vec<_> = chunks.iter().map(|chunk| (chunk.first_index, chunk.count)).collect();
        assert_eq!(counts, [(103, 7), (110, 7), (117, 3)]);
        let mut feed = Vec::new();
        for chunk in &chunks {
            assert_eq!(chunk.line_runs.iter().map(|run| run.count).sum::<u32>(), chunk.count);
            let column = &chunk.columns[2];
            feed.extend(&column.values);
            feed.extend(delta::decode(&column.deltas, 1e-6));
            feed.extend(raw_double::decode(&column.raw).unwrap());
        }
        assert_eq!(feed, block.feed_mm_per_min[3..]);
    }
}

#[test]
fn a_reader_that_left_stops_the_writer() {
    let machine = Machine::lathe();
    let set = select(&[], false, proto::Encoding::PackedDouble).unwrap();
    let mut writer = ChunkWriter::new(&set, 2, 0);
    let mut sent = 0;
    assert!(!writer.write(&block(&machine, 20), 0..20, |_| {
        sent += 1;
        sent < 3
    }));
    assert_eq!(sent, 3);
}

#[test]
fn chunks_stay_below_what_clients_accept() {
    let set = select(&[], true, proto::Encoding::PackedDouble).unwrap();
    assert!(set.chunk_size(MAX_CHUNK_SIZE) * 8 * set.infos().len() <= MAX_CHUNK_BYTES);
    assert_eq!(set.chunk_size(64), 64);
    assert!(set.chunk_size(0) * 8 * set.infos().len() <= DEFAULT_CHUNK_BYTES);
}
