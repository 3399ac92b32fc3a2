//! Programs uploaded piece by piece.

use bytes::Bytes;
use feedwave_store::{
    CHUNK_BYTES, ProgramId, Store, StoreError, StoreSettings, Tenant, UploadBound, UploadInfo, UploadStart,
};

use super::{Place, open, read_back, source};

const CHUNK: usize = CHUNK_BYTES as usize;

async fn begin(store: &Store, expected: ProgramId, size: usize) -> UploadInfo {
    match store.begin_upload(expected, size as u64, "").await.unwrap() {
        UploadStart::Unfinished(upload) => upload,
        UploadStart::Complete(program) => panic!("{program:?} is stored already"),
    }
}

#[tokio::test]
async fn pieces_of_any_size_make_the_program() {
    let place = Place::new();
    let store = open(&place).await;
    // Around the chunk's edge, within a chunk, across several, and all at once.
    for (round, pieces) in [
        &[CHUNK - 1, 1, 1, CHUNK, 3][..],
        &[7, 100_000, 1_500_000, 9],
        &[5 * CHUNK + 5],
        &[CHUNK],
        &[1, 1, 1],
        &[0, 2, 0],
    ]
    .into_iter()
    .enumerate()
    {
        let source = source(pieces.iter().sum::<usize>() + round);
        let source = &source[round..];
        let id = ProgramId::of(source);
        let upload = begin(&store, id, source.len()).await;
        let mut rest = Bytes::copy_from_slice(source);
        let mut offset = 0;
        for &piece in pieces {
            let piece = rest.split_to(piece);
            let received = store.append_upload(upload.id, offset, piece.clone()).await.unwrap();
            offset += piece.len() as u64;
            assert_eq!(received, offset);
            assert_eq!(store.upload(upload.id).await.unwrap().received_bytes, offset);
            assert!(matches!(store.program_info(id).await, Err(StoreError::NotFound { .. })), "not visible yet");
        }
        let program = store.finish_upload(upload.id).await.unwrap();
        assert_eq!((program.id, program.size_bytes), (id, source.len() as u64));
        assert_eq!(read_back(&store, id).await, source, "pieces {pieces:?}");
        assert!(matches!(store.upload(upload.id).await, Err(StoreError::NotFound { .. })));
    }
    assert!(store.uploads().await.unwrap().is_empty());
}

#[tokio::test]
async fn an_empty_program_needs_no_bytes() {
    let place = Place::new();
    let store = open(&place).await;
    let upload = begin(&store, ProgramId::of(b""), 0).await;
    let program = store.finish_upload(upload.id).await.unwrap();
    assert_eq!((program.size_bytes, program.chunk_count), (0, 0));
}

#[tokio::test]
async fn an_upload_resumes_after_reopening() {
    let place = Place::new();
    let source = source(2 * CHUNK + 12_345);
    let id = ProgramId::of(&source);
    let cut = CHUNK + 777;
    let store = open(&place).await;
    let upload = begin(&store, id, source.len()).await;
    store.append_upload(upload.id, 0, Bytes::copy_from_slice(&source[..cut])).await.unwrap();
    drop(store);

    let store = open(&place).await;
    let resumed = begin(&store, id, source.len()).await;
    assert_eq!((resumed.id, resumed.received_bytes), (upload.id, cut as u64));
    store.append_upload(resumed.id, cut as u64, Bytes::copy_from_slice(&source[cut..])).await.unwrap();
    store.finish_upload(resumed.id).await.unwrap();
    assert_eq!(read_back(&store, id).await, source);

    match store.begin_upload(id, source.len() as u64, "").await.unwrap() {
        UploadStart::Complete(program) => assert_eq!(program.id, id),
        other => panic!("a complete program is uploaded again: {other:?}"),
    }
}

#[tokio::test]
async fn a_wrong_offset_names_the_right_one() {
    let place = Place::new();
    let store = open(&place).await;
    let upload = begin(&store, ProgramId::of(b"abcdef"), 6).await;
    store.append_upload(upload.id, 0, "abc".into()).await.unwrap();
    for given in [0, 2, 4, u64::MAX] {
        let refused = store.append_upload(upload.id, given, "d".into()).await;
        assert!(
            matches!(refused, Err(StoreError::WrongOffset { expected: 3, given: named, .. }) if named == given),
            "{refused:?}"
        );
    }
    let refused = store.append_upload(upload.id, 3, "defg".into()).await;
    assert!(matches!(refused, Err(StoreError::TooLarge { size: 7, limit: 6, .. })), "{refused:?}");
    let refused = store.finish_upload(upload.id).await;
    assert!(matches!(refused, Err(StoreError::Incomplete { received: 3, expected: 6, .. })), "{refused:?}");
    store.append_upload(upload.id, 3, "def".into()).await.unwrap();
    store.finish_upload(upload.id).await.unwrap();
}

#[tokio::test]
async fn of_racing_appends_one_wins() {
    let place = Place::new();
    let store = open(&place).await;
    let source = Bytes::from(source(3 * CHUNK));
    let upload = begin(&store, ProgramId::of(&source), source.len()).await;
    let mut appends = tokio::task::JoinSet::new();
    for end in [CHUNK + 1, 2 * CHUNK, 3 * CHUNK, 5, 6] {
        let (store, piece) = (store.clone(), source.slice(..end));
        appends.spawn(async move { store.append_upload(upload.id, 0, piece).await });
    }
    let outcomes = appends.join_all().await;
    let winners: Vec<_> = outcomes.iter().filter_map(|outcome| outcome.as_ref().ok()).collect();
    assert_eq!(winners.len(), 1, "{outcomes:?}");
    let received = *winners[0];
    assert_eq!(store.upload(upload.id).await.unwrap().received_bytes, received);
    store.append_upload(upload.id, received, source.slice(received as usize..)).await.unwrap();
    let program = store.finish_upload(upload.id).await.unwrap();
    assert_eq!(read_back(&store, program.id).await, source);
}

#[tokio::test]
async fn a_wrong_hash_discards_the_upload() {
    let place = Place::new();
    let store = open(&place).await;
    let expected = ProgramId::of(b"right");
    let upload = begin(&store, expected, 5).await;
    store.append_upload(upload.id, 0, "wrong".into()).await.unwrap();
    match store.finish_upload(upload.id).await {
        Err(StoreError::HashMismatch { expected: named, actual }) => {
            assert_eq!((*named, *actual), (expected, ProgramId::of(b"wrong")));
        }
        other => panic!("{other:?}"),
    }
    assert!(matches!(store.upload(upload.id).await, Err(StoreError::NotFound { .. })));
    for hash in [expected, ProgramId::of(b"wrong")] {
        assert!(matches!(store.program_info(hash).await, Err(StoreError::NotFound { .. })));
    }
    assert_eq!(begin(&store, expected, 5).await.received_bytes, 0, "a new attempt starts anew");
}

#[tokio::test]
async fn uploads_are_limited_listed_and_deleted() {
    let place = Place::new();
    let limits = StoreSettings { max_uploads: 2, max_program_bytes: 100, ..StoreSettings::default() };
    let store = place.open(limits).await;
    let first = begin(&store, ProgramId::of(b"1"), 1).await;
    let second = begin(&store, ProgramId::of(b"2"), 1).await;
    let refused = store.begin_upload(ProgramId::of(b"3"), 1, "").await;
    assert!(matches!(refused, Err(StoreError::LimitReached { limit: 2, .. })), "{refused:?}");
    assert_eq!(begin(&store, ProgramId::of(b"1"), 1).await.id, first.id, "resuming needs no further place");
    assert_eq!(store.uploads().await.unwrap(), [first.clone(), second.clone()]);

    store.delete_upload(first.id).await.unwrap();
    assert!(matches!(store.delete_upload(first.id).await, Err(StoreError::NotFound { .. })));
    let appended = store.append_upload(first.id, 0, "1".into()).await;
    assert!(matches!(appended, Err(StoreError::NotFound { .. })), "{appended:?}");
    begin(&store, ProgramId::of(b"3"), 1).await;

    let refused = store.begin_upload(ProgramId::of(b"4"), 101, "").await;
    assert!(matches!(refused, Err(StoreError::TooLarge { size: 101, limit: 100, .. })), "{refused:?}");
}

#[tokio::test]
async fn bytes_that_are_announced_have_bounds() {
    let place = Place::new();
    let limits = StoreSettings { max_uploads_bytes: 100, max_client_uploads_bytes: 60, ..StoreSettings::default() };
    let store = place.open(limits).await;
    let begin = async |number: u8, bytes, client| store.begin_upload(ProgramId::of(&[number]), bytes, client).await;
    let Ok(UploadStart::Unfinished(first)) = begin(1, 40, "a").await else { panic!("nothing was uploaded yet") };
    let refused = begin(2, 21, "a").await;
    assert!(
        matches!(refused, Err(StoreError::LimitReached { bound: UploadBound::ClientBytes, limit: 60 })),
        "{refused:?}"
    );
    begin(2, 20, "a").await.unwrap();
    let refused = begin(3, 41, "b").await;
    assert!(matches!(refused, Err(StoreError::LimitReached { bound: UploadBound::Bytes, limit: 100 })), "{refused:?}");
    begin(3, 40, "b").await.unwrap();
    // To go on takes nothing more, and what is discarded makes room.
    begin(1, 40, "a").await.unwrap();
    store.delete_upload(first.id).await.unwrap();
    begin(4, 40, "a").await.unwrap();
}

#[tokio::test]
async fn a_client_has_its_share_and_what_nobody_goes_on_with_expires() {
    let place = Place::new();
    let limits = StoreSettings { max_uploads: 3, max_client_uploads: 2, ..StoreSettings::default() };
    let store = place.open(limits.clone()).await;
    for (source, client) in [(b"1", "a"), (b"2", "a")] {
        store.begin_upload(ProgramId::of(source), 1, client).await.unwrap();
    }
    let refused = store.begin_upload(ProgramId::of(b"3"), 1, "a").await;
    assert!(
        matches!(refused, Err(StoreError::LimitReached { bound: UploadBound::ClientUploads, limit: 2 })),
        "{refused:?}"
    );
    store.begin_upload(ProgramId::of(b"3"), 1, "b").await.unwrap();
    let refused = store.begin_upload(ProgramId::of(b"4"), 1, "b").await;
    assert!(matches!(refused, Err(StoreError::LimitReached { bound: UploadBound::Uploads, limit: 3 })), "{refused:?}");
    assert_eq!(store.uploads().await.unwrap()[2].client, "b");
    assert_eq!(store.expire_uploads().await.unwrap(), 0);
    drop(store);

    let store = place.open(StoreSettings { upload_expiry: std::time::Duration::ZERO, ..limits }).await;
    // They expire when asked for, and before anybody is refused for them.
    let UploadStart::Unfinished(fourth) = store.begin_upload(ProgramId::of(b"4"), 1, "b").await.unwrap() else {
        panic!("nothing was uploaded yet");
    };
    assert_eq!(store.uploads().await.unwrap(), [fourth]);
    assert_eq!(store.expire_uploads().await.unwrap(), 1);
}

#[tokio::test]
async fn a_program_that_came_another_way_wins() {
    let place = Place::new();
    let store = open(&place).await;
    let upload = begin(&store, ProgramId::of(b"same"), 4).await;
    store.append_upload(upload.id, 0, "same".into()).await.unwrap();
    let put = store.put_program(Tenant::DEFAULT, "same".into()).await.unwrap();
    assert_eq!(store.finish_upload(upload.id).await.unwrap(), put);
    assert_eq!(read_back(&store, put.id).await, b"same");
}
