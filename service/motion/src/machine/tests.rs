use super::*;

fn fields(machine: &Machine) -> Vec<String> {
    machine.validate().into_iter().map(|problem| problem.field).collect()
}

/// Refusal of one changed field of the first axis.
fn fields_after(change: impl Fn(&mut Machine)) -> Vec<String> {
    let mut machine = Machine::lathe();
    change(&mut machine);
    fields(&machine)
}

#[test]
fn the_built_in_machines_are_valid() {
    assert!(Machine::lathe().validate().is_empty());
    assert!(Machine::mill().validate().is_empty());
}

#[test]
fn every_axis_limit_must_be_a_number_within_its_range() {
    for bad in [0.0, -1.0, 1e-4, 1e16, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(fields_after(|machine| machine.axes[0].max_velocity_per_s = bad), ["axes[0].max_velocity_per_s"]);
        assert_eq!(
            fields_after(|machine| machine.axes[0].max_acceleration_per_s2 = bad),
            ["axes[0].max_acceleration_per_s2"]
        );
        assert_eq!(fields_after(|machine| machine.axes[1].max_jerk_per_s3 = bad), ["axes[1].max_jerk_per_s3"]);
        assert_eq!(fields_after(|machine| machine.max_spindle_rev_per_min = bad), ["max_spindle_rev_per_min"]);
    }
}

#[test]
fn travel_limits_must_be_finite_and_ordered() {
    for bad in [f64::NAN, f64::INFINITY, 2e6] {
        assert_eq!(fields_after(|machine| machine.axes[0].travel_max = Some(bad)), ["axes[0].travel_max"]);
    }
    assert_eq!(fields_after(|machine| machine.axes[0].travel_min = Some(f64::NEG_INFINITY)), ["axes[0].travel_min"]);
    let ordered = |min: f64, max: f64| {
        fields_after(|machine| {
            machine.axes[1].travel_min = Some(min);
            machine.axes[1].travel_max = Some(max);
        })
    };
    assert_eq!(ordered(1.0, 1.0), ["axes[1].travel_max"]);
    assert_eq!(ordered(1.0, -1.0), ["axes[1].travel_max"]);
    assert!(ordered(-300.0, 0.0).is_empty());
}

#[test]
fn names_belong_to_one_axis_each() {
    assert_eq!(fields_after(|machine| machine.axes[1].name = "X".to_owned()), ["axes[1].name"]);
    for bad in ["", "X 1", "X,1", "Ä", "ABCDEFGHIJKLMNOPQ", "X\n"] {
        assert_eq!(fields_after(|machine| machine.axes[0].name = bad.to_owned()), ["axes[0].name"], "{bad:?}");
    }
    assert!(fields_after(|machine| machine.axes[0].name = "X_1".to_owned()).is_empty());
}

#[test]
fn a_gantry_has_two_axes_for_one_letter() {
    let mut machine = Machine::mill();
    machine.axes[0].name = "X1".to_owned();
    let mut twin = MachineAxis::new(Axis::X, 400.0, 8_000.0, 4e6);
    (twin.name, twin.carried_by, twin.travel_max) = ("X2".to_owned(), CarriedBy::Workpiece, Some(50.0));
    machine.axes.insert(1, twin);
    assert!(machine.validate().is_empty());
    assert_eq!((machine.axis_value(0, 10.0, 5.0), machine.axis_value(1, 10.0, 5.0)), (15.0, -15.0));
    assert_eq!(machine.column_of(Axis::X), Some(0));
    machine.axes[1].name = "X1".to_owned();
    assert_eq!(fields(&machine), ["axes[1].name"]);
}

#[test]
fn a_velocity_step_is_zero_or_a_small_velocity() {
    for good in [0.0, 0.1, 1e3] {
        assert!(fields_after(|machine| machine.axes[1].max_velocity_step_per_s = good).is_empty(), "{good}");
    }
    for bad in [-0.1, 1e3 + 1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(
            fields_after(|machine| machine.axes[1].max_velocity_step_per_s = bad),
            ["axes[1].max_velocity_step_per_s"]
        );
    }
}

#[test]
fn one_to_nine_axes_make_a_machine() {
    let with = |count: usize| {
        let axes = Axis::ALL.into_iter().cycle().take(count).map(|axis| MachineAxis::new(axis, 100.0, 1e3, 1e5));
        Machine { axes: axes.collect(), ..Machine::mill() }
    };
    assert_eq!(fields(&with(0)), ["axes"]);
    for count in 1..=9 {
        assert!(with(count).validate().is_empty(), "{count}");
    }
    assert_eq!(fields(&with(10)), ["axes"]);
    // The list comes from outside: however long, the answer is short.
    assert_eq!(fields(&with(100_000)), ["axes"]);
}

#[test]
fn every_problem_is_reported_at_once() {
    let mut machine = Machine::lathe();
    machine.axes[0].max_velocity_per_s = 0.0;
    machine.axes[1].name = String::new();
    machine.max_spindle_rev_per_min = f64::NAN;
    assert_eq!(fields(&machine), ["axes[0].max_velocity_per_s", "axes[1].name", "max_spindle_rev_per_min"]);
}

#[test]
fn axis_values_follow_the_offset_and_the_carried_side() {
    let mut machine = Machine::mill();
    assert_eq!(machine.axis_value(0, 10.0, -300.0), -290.0);
    machine.axes[0].carried_by = CarriedBy::Workpiece;
    assert_eq!(machine.axis_value(0, 10.0, -300.0), 290.0);
    assert_eq!(machine.column_of(Axis::Z), Some(2));
    assert_eq!(machine.column_of(Axis::C), None);
}

#[test]
fn json_keeps_every_value_and_refuses_unknown_and_missing_fields() {
    let mut machine = Machine::lathe();
    machine.axes[1].travel_min = Some(-0.1);
    machine.axes[1].carried_by = CarriedBy::Workpiece;
    machine.axes[1].max_velocity_step_per_s = 0.3;
    let json = serde_json::to_string(&machine).expect("a machine is plain data");
    assert_eq!(serde_json::from_str::<Machine>(&json).expect("its own output"), machine);

    let axis = r#"{"name":"X","axis":"X","max_velocity_per_s":1.0,"max_acceleration_per_s2":1.0,"max_jerk_per_s3":1.0"#;
    let with = |axis_rest: &str, machine_rest: &str| {
        format!(r#"{{"kind":"lathe","axes":[{axis}{axis_rest}}}],"max_spindle_rev_per_min":1.0{machine_rest}}}"#)
    };
    let machine: Machine = serde_json::from_str(&with("", "")).expect("the rest has defaults");
    assert_eq!((machine.axes[0].travel_min, machine.axes[0].carried_by), (None, CarriedBy::Tool));
    assert_eq!(machine.axes[0].max_velocity_step_per_s, 0.0);
    for bad in [
        with(r#","max_speed":1"#, ""),
        with("", r#","axis_count":1"#),
        r#"{"kind":"lathe","axes":[]}"#.to_owned(),
        r#"{"kind":"press","axes":[],"max_spindle_rev_per_min":1.0}"#.to_owned(),
        r#"{"kind":"lathe","axes":[{"name":"X"}],"max_spindle_rev_per_min":1.0}"#.to_owned(),
    ] {
        assert!(serde_json::from_str::<Machine>(&bad).is_err(), "{bad}");
    }
}
