use proptest::prelude::*;
use prost::{Message as _, Name};

use super::*;
use crate::proto::{
    Action, CreateJobRequest, CreateMachineRequest, CreateToolRequest, Finding, IngestRequest, InterpretRequest, Job,
    Machine, MachineCode, ProgramFile, RunRequest, SpindleAngles, StabilityPocket, StreamSetpointsRequest,
    TelemetryBatch, Tool,
};

fn shape<T: Name>() -> Shape {
    Shape::named(&T::full_name()).unwrap()
}

fn cost<T: Name>(wire: &[u8]) -> u64 {
    shape::<T>().decoded_bytes(wire)
}

#[test]
fn no_value_is_larger_than_is_told() {
    fn check<T: Name>() {
        let (told, has) = (shape::<T>().value_bytes(), size_of::<T>() as u64);
        assert!(told >= has, "{}: {told} told, {has} taken", T::NAME);
        // Nor is it told to be what nothing could be sent for.
        assert!(told <= 3 * has, "{}: {told} told, {has} taken", T::NAME);
    }
    check::<Action>();
    check::<CreateJobRequest>();
    check::<CreateMachineRequest>();
    check::<CreateToolRequest>();
    check::<Finding>();
    check::<IngestRequest>();
    check::<InterpretRequest>();
    check::<Job>();
    check::<Machine>();
    check::<MachineCode>();
    check::<ProgramFile>();
    check::<RunRequest>();
    check::<StabilityPocket>();
    check::<StreamSetpointsRequest>();
    check::<TelemetryBatch>();
    check::<Tool>();
}

#[test]
fn empty_messages_cost_what_their_values_take() {
    let files = CreateJobRequest { programs: vec![ProgramFile::default(); 5_000], ..CreateJobRequest::default() };
    let wire = files.encode_to_vec();
    assert!(wire.len() < 3 * 5_000 + 10);
    let decoded = CreateJobRequest::decode(wire.as_slice()).unwrap();
    let taken = (decoded.programs.capacity() * size_of::<ProgramFile>()) as u64;
    let told = cost::<CreateJobRequest>(&wire);
    assert!((taken..=4 * taken).contains(&told), "{told} told, {taken} taken");
}

#[test]
fn numbers_cost_what_they_take_packed_or_not() {
    let packed = SpindleAngles { angles_deg: vec![1.0; 1_000], ..Default::default() };
    let told = cost::<SpindleAngles>(&packed.encode_to_vec());
    assert!((8_000..20_000).contains(&told), "{told}");
    let mut single = Vec::new();
    for _ in 0..1_000 {
        single.push(1 << 3 | 1);
        single.extend(1_f64.to_le_bytes());
    }
    let again = cost::<SpindleAngles>(&single);
    assert!((8_000..20_000).contains(&again), "{again}");
}

#[test]
fn what_nobody_knows_costs_nothing_and_hides_nothing() {
    // A group of an unknown field, within it what would be a file elsewhere, and a file behind it.
    let group = [(900_u32 << 3 | 3), 900 << 3 | 4].map(|key| {
        let mut bytes = Vec::new();
        prost::encoding::encode_varint(key.into(), &mut bytes);
        bytes
    });
    let file =
        CreateJobRequest { programs: vec![ProgramFile::default()], ..CreateJobRequest::default() }.encode_to_vec();
    let within = [group[0].as_slice(), &file, &group[1]].concat();
    assert_eq!(cost::<CreateJobRequest>(&within), 0);
    let behind = [within.as_slice(), &file].concat();
    assert_eq!(cost::<CreateJobRequest>(&behind), cost::<CreateJobRequest>(&file));
    assert!(CreateJobRequest::decode(behind.as_slice()).is_ok());
}

proptest! {
    #[test]
    fn any_bytes_have_a_cost(wire in prop::collection::vec(any::<u8>(), 0..200)) {
        // At most the largest value twice, and its first space, for every two bytes.
        let largest = SHAPES.messages.iter().map(|message| message.value_bytes).max().unwrap();
        prop_assert!(cost::<CreateJobRequest>(&wire) <= (wire.len() as u64 + 1) * (4 * largest + 2 * PIECE_BYTES));
    }
}
