//! Any order of upload calls, with the database reopened in between, behaves like a list of bytes: offsets are kept,
//! nothing acknowledged is lost, and a program appears exactly when all its bytes have arrived and have its hash. The fuzz target
//! `upload` and the random tests here run it.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use bytes::Bytes;
use feedwave_store::{ProgramId, Store, StoreError, UploadStart};

/// Several sizes: none, one byte, within one stored chunk, over the boundary between two.
const SIZES: [usize; 4] = [0, 1, 5_000, (1 << 20) + 3];

static PROGRAMS: LazyLock<Vec<(ProgramId, Bytes)>> = LazyLock::new(|| {
    let content = |size: usize| -> Bytes { (0..size).map(|index| (index * 7 + index / 251) as u8).collect() };
    SIZES.into_iter().map(content).map(|content| (ProgramId::of(&content), content)).collect()
});

/// What has arrived of each unfinished upload, by program.
type Model = BTreeMap<usize, Vec<u8>>;

/// Carries out the calls that the input says on an empty store that takes two uploads, which `open` opens again. Panics where
/// it is not like the list; the store is empty again then.
// As long as the kinds of steps.
pub async fn check(mut store: Store, open: impl AsyncFn() -> Store, input: &[u8]) -> Store {
    let mut unfinished = Model::new();
    let mut complete = [false; SIZES.len()];

    for step in input.chunks_exact(4).take(64) {
        let which = usize::from(step[1]) % SIZES.len();
        let (id, content) = &PROGRAMS[which];
        let id = *id;
        let begun = store.begin_upload(id, content.len() as u64, "").await;
        let upload = match begun {
            Ok(UploadStart::Complete(program)) => {
                assert!(complete[which]);
                assert_eq!(program.size_bytes, content.len() as u64);
                if step[0] % 6 == 5 {
                    store.delete_program(id).await.expect("no job uses it");
                    complete[which] = false;
                }
                continue;
            }
            Ok(UploadStart::Unfinished(upload)) => upload,
            Err(StoreError::LimitReached { .. }) => {
                assert!(unfinished.len() == 2 && !unfinished.contains_key(&which));
                continue;
            }
            Err(error) => panic!("{error:?}"),
        };
        assert!(!complete[which]);
        let received = unfinished.entry(which).or_default();
        assert_eq!(upload.received_bytes, received.len() as u64, "what was acknowledged is there");
        let length = (usize::from(step[2]) << (step[3] % 16)).min(2 << 20);
        match step[0] % 6 {
            // The right bytes, as many as are missing at most.
            0 | 1 => {
                let end = content.len().min(received.len() + length);
                let piece = content.slice(received.len()..end);
                received.extend_from_slice(&piece);
                let acknowledged = store.append_upload(upload.id, upload.received_bytes, piece).await;
                assert_eq!(acknowledged.expect("room is left"), end as u64);
            }
            // Wrong bytes, at any offset, as many as come.
            2 => {
                let offset = u64::from(step[3]);
                let fits = offset == received.len() as u64 && received.len() + length <= content.len();
                let piece = vec![step[1]; length];
                let appended = store.append_upload(upload.id, offset, piece.clone().into()).await;
                match appended {
                    Ok(acknowledged) => {
                        assert!(fits || length == 0);
                        received.extend_from_slice(&piece);
                        assert_eq!(acknowledged, received.len() as u64);
                    }
                    Err(error) => assert!(!fits, "{error:?}"),
                }
            }
            3 => match store.finish_upload(upload.id).await {
                Ok(program) => {
                    assert!(received == content && program.id == id);
                    complete[which] = true;
                    unfinished.remove(&which);
                }
                Err(StoreError::Incomplete { .. }) => assert!(received.len() < content.len()),
                Err(StoreError::HashMismatch { .. }) => {
                    assert!(received.len() == content.len() && received != content);
                    unfinished.remove(&which);
                }
                Err(error) => panic!("{error:?}"),
            },
            4 => {
                store.close().await;
                store = open().await;
            }
            _ => {
                store.delete_upload(upload.id).await.expect("it is there");
                unfinished.remove(&which);
            }
        }
    }
    empty(&store, complete).await;
    store
}

/// What is complete is stored as it was sent, and nothing else; all of it is deleted.
async fn empty(store: &Store, complete: [bool; SIZES.len()]) {
    for (which, (id, content)) in PROGRAMS.iter().enumerate() {
        if complete[which] {
            let chunks = content.len().div_ceil(1 << 20);
            let mut stored = Vec::new();
            for chunk in 0..chunks {
                stored.extend_from_slice(&store.program_chunk(*id, chunk as u64).await.expect("a complete program"));
            }
            assert!(stored == *content);
            store.delete_program(*id).await.expect("no job uses it");
        } else {
            assert!(store.program_info(*id).await.is_err());
        }
    }
    for upload in store.uploads().await.expect("the uploads are listed") {
        store.delete_upload(upload.id).await.expect("it is there");
    }
}
