use std::fs::File;
use std::path::Path;

use feedwave_contract::columns::Extras;
use feedwave_cutting::SetpointBlock;
use feedwave_motion::Machine;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;

use super::{FileFormat, Layout, OutputFile, create};

/// A machine with the axes X and C.
fn machine() -> Machine {
    let mut machine = Machine::lathe();
    machine.axes[1].name = "C".to_owned();
    machine.axes[1].axis = feedwave_program::Axis::C;
    machine
}

fn layout(extras: Extras, period_us: f64) -> Layout {
    Layout::of_machine(&machine(), extras, period_us)
}

#[allow(clippy::cast_precision_loss)]
fn block(first_index: u64, rows: u32) -> SetpointBlock {
    let column = |step: f64| (0..rows).map(|row| (first_index as f64 + f64::from(row)) * step).collect::<Vec<_>>();
    SetpointBlock {
        first_index,
        axes: vec![column(0.1), vec![90.0; rows as usize]],
        tool_direction: Vec::new(),
        path_position_mm: column(1.0 / 3.0),
        feed_mm_per_min: vec![0.1 + 0.2; rows as usize],
        vibration_offset_mm: column(-1e-9),
        spindle_angle_deg: column(6.0),
        line: (0..rows).map(|row| row / 10 + 1).collect(),
        servo: None,
    }
}

fn write(path: &Path, format: FileFormat, blocks: &[SetpointBlock]) {
    let mut writer = create(path, format, layout(Extras::default(), 250.0)).unwrap();
    for block in blocks {
        writer.write(block, 0..block.len()).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn csv_has_units_and_the_shortest_numbers() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.csv");
    write(&path, FileFormat::Csv, &[block(0, 3)]);
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next().unwrap(),
        "index,time_s,X_mm,C_deg,path_position_mm,feed_mm_per_min,vibration_offset_mm,spindle_angle_deg,source_line"
    );
    assert_eq!(lines.next().unwrap(), "0,0,0,90,0,0.30000000000000004,-0,0,1");
    assert_eq!(lines.next().unwrap(), "1,0.00025,0.1,90,0.3333333333333333,0.30000000000000004,-0.000000001,6,1");
    assert_eq!(lines.count(), 1);
}

#[test]
fn parquet_holds_the_same_numbers_as_csv() {
    let directory = tempfile::tempdir().unwrap();
    let (csv, parquet) = (directory.path().join("a.csv"), directory.path().join("a.parquet"));
    // More than one row group.
    let blocks: Vec<_> = (0..140).map(|number| block(number * 1_024, 1_024)).collect();
    write(&csv, FileFormat::Csv, &blocks);
    write(&parquet, FileFormat::Parquet, &blocks);

    let text = std::fs::read_to_string(csv).unwrap();
    let mut lines = text.lines();
    let header: Vec<_> = lines.next().unwrap().split(',').map(str::to_owned).collect();
    let reader = SerializedFileReader::new(File::open(parquet).unwrap()).unwrap();
    assert_eq!(reader.num_row_groups(), 2);
    let units = reader.metadata().file_metadata().key_value_metadata().unwrap();
    assert!(units.iter().any(|entry| entry.key == "unit:C_deg" && entry.value.as_deref() == Some("deg")));
    let mut rows = 0;
    for (row, line) in reader.get_row_iter(None).unwrap().zip(&mut lines) {
        let row = row.unwrap();
        for ((name, field), (wanted_name, wanted)) in row.get_column_iter().zip(header.iter().zip(line.split(','))) {
            assert_eq!(name, wanted_name);
            match field {
                Field::Long(value) => assert_eq!(value.to_string(), *wanted),
                Field::Int(value) => assert_eq!(value.to_string(), *wanted),
                Field::Double(value) => assert_eq!(value.to_bits(), wanted.parse::<f64>().unwrap().to_bits()),
                other => panic!("unexpected {other:?}"),
            }
        }
        rows += 1;
    }
    assert_eq!(rows, 140 * 1_024);
    assert_eq!(lines.next(), None);
}

#[test]
fn an_unfinished_file_leaves_nothing_and_keeps_what_was_there() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.csv");
    std::fs::write(&path, "before").unwrap();
    let mut writer = create(&path, FileFormat::Csv, layout(Extras::default(), 1_000.0)).unwrap();
    let block = block(0, 1_000);
    for _ in 0..10 {
        writer.write(&block, 0..1_000).unwrap();
    }
    drop(writer);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "before");
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
}

#[cfg(unix)]
#[test]
fn what_a_link_points_to_is_replaced_and_keeps_its_mode() {
    use std::os::unix::fs::{PermissionsExt as _, symlink};
    let directory = tempfile::tempdir().unwrap();
    let place = |name: &str| directory.path().join(name);
    std::fs::create_dir(place("far")).unwrap();
    std::fs::write(place("far/a.nc"), "before").unwrap();
    std::fs::set_permissions(place("far/a.nc"), std::fs::Permissions::from_mode(0o640)).unwrap();
    for (target, link) in [("far/a.nc", "one.nc"), ("one.nc", "two.nc"), ("far/new.nc", "dangling.nc")] {
        symlink(target, place(link)).unwrap();
    }
    OutputFile::write_whole(&place("two.nc"), b"after").unwrap();
    OutputFile::write_whole(&place("dangling.nc"), b"new").unwrap();
    assert!(["one.nc", "two.nc", "dangling.nc"].iter().all(|link| place(link).is_symlink()));
    assert_eq!(std::fs::read_to_string(place("far/a.nc")).unwrap(), "after");
    assert_eq!(std::fs::metadata(place("far/a.nc")).unwrap().permissions().mode() & 0o777, 0o640);
    assert_eq!(std::fs::read_to_string(place("far/new.nc")).unwrap(), "new");
    assert_eq!(std::fs::read_dir(place("far")).unwrap().count(), 2);
    symlink("circle.nc", place("circle.nc")).unwrap();
    assert!(OutputFile::create(&place("circle.nc")).is_err());
}

#[test]
fn servo_conditions_are_columns_of_their_own() {
    let layout = layout(Extras { conditions: true, directions: false }, 1_000.0);
    let names: Vec<_> = layout.columns().iter().map(|column| column.name.as_str()).collect();
    assert_eq!(
        names[8..],
        [
            "X_vibration_amplitude_mm",
            "C_vibration_amplitude_deg",
            "vibration_frequency_hz",
            "vibration_phase_turns",
            "X_clamp_low_mm",
            "C_clamp_low_deg",
            "X_clamp_high_mm",
            "C_clamp_high_deg",
            "source_line"
        ]
    );
}

#[test]
fn times_are_the_decimals_a_person_would_write_and_find_their_index() {
    let layout = layout(Extras::default(), 100.0);
    for index in [0, 1, 3, 7, 1_000_003] {
        let time_s = layout.time_s(index);
        assert_eq!(time_s, format!("{index}e-4").parse::<f64>().unwrap());
        assert_eq!(layout.index_at(time_s), index);
    }
    assert_eq!(layout.index_at(0.000_15), 2);
}
