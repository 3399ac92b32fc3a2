//! What every database behind the store must do, written against the traits alone. A backend runs
//! it all with `suite!(Backend)`.

pub(crate) mod checkpoints;
pub(crate) mod documents;
pub(crate) mod jobs;
pub(crate) mod programs;
pub(crate) mod runs;
pub(crate) mod uploads;

use feedwave_store::{
    Checkpoints, Fingerprint, Jobs, Json, Machines, NewJob, ProgramId, Programs, RawValue, Runs, StoreSettings, Tools,
};

/// A store with everything a database must provide.
pub(crate) trait Full:
    Programs + Jobs + Checkpoints + Runs + Machines + Tools + Clone + Send + Sync + 'static
{
}

impl<S> Full for S where S: Programs + Jobs + Checkpoints + Runs + Machines + Tools + Clone + Send + Sync + 'static {}

/// A place that keeps what is stored between two openings.
pub(crate) trait Backend {
    /// The store under test.
    type Store: Full;

    /// A new, empty place.
    fn new() -> Self;

    /// Opens the store at this place.
    fn open(&self, settings: StoreSettings) -> impl Future<Output = Self::Store> + Send;
}

/// Generates a test per function of the suite for one backend.
macro_rules! suite {
    ($backend:ty: $($module:ident { $($test:ident),* $(,)? })*) => {
        $(mod $module {
            $(#[tokio::test]
            async fn $test() {
                crate::suite::$module::$test(<$backend as crate::suite::Backend>::new()).await;
            })*
        })*
    };
}
pub(crate) use suite;

pub(crate) async fn open<B: Backend>(backend: &B) -> B::Store {
    backend.open(StoreSettings::default()).await
}

pub(crate) fn json(text: &str) -> Json {
    RawValue::from_string(text.to_owned()).expect("test documents are JSON")
}

pub(crate) fn new_job(request: &str, program_id: ProgramId) -> NewJob {
    NewJob {
        request_id: request.into(),
        fingerprint: Fingerprint::of([request.as_bytes()]),
        display_name: format!("job of {request}"),
        program_id,
        machine_id: "lathe-1".into(),
        machine_snapshot: json(r#"{"axes":["X","Z"]}"#),
        settings: json(r#"{"interpolation_period_us":1000}"#),
    }
}

/// A store with one small program.
pub(crate) async fn with_program<B: Backend>(backend: &B) -> (B::Store, ProgramId) {
    let store = open(backend).await;
    let program = store.put_program("G1 X10 F100\nM30\n".into()).await.expect("stores a program");
    (store, program.id)
}

/// Bytes that look like a program, differ everywhere, and compress somewhat.
pub(crate) fn source(bytes: usize) -> Vec<u8> {
    let mut source = Vec::with_capacity(bytes + 64);
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    while source.len() < bytes {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        source.extend_from_slice(format!("G1 X{} Z-{}\n", state >> 44, (state >> 20) & 0xfffff).as_bytes());
    }
    source.truncate(bytes);
    source
}

/// Everything a program's chunks hold, read in order.
pub(crate) async fn read_back(store: &impl Full, id: ProgramId) -> Vec<u8> {
    let info = store.program_info(id).await.expect("the program exists");
    let mut source = Vec::new();
    for index in 0..info.chunk_count {
        source.extend_from_slice(&store.program_chunk(id, index).await.expect("the chunk exists"));
    }
    source
}
