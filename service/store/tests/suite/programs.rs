//! Programs put as a whole.

use feedwave_store::{CHUNK_BYTES, Kind, MAX_PUT_BYTES, ProgramId, StoreError, StoreSettings};

use super::{Place, new_job, open, read_back, source, with_program};

#[tokio::test]
async fn put_is_idempotent_and_addressed_by_content() {
    let place = Place::new();
    let store = open(&place).await;
    let first = store.put_program("G0 X1\n".into()).await.unwrap();
    let again = store.put_program("G0 X1\n".into()).await.unwrap();
    assert_eq!(first, again);
    assert_eq!(first.id, ProgramId::of(b"G0 X1\n"));
    assert_eq!((first.size_bytes, first.chunk_count), (6, 1));
    assert_eq!(store.program_info(first.id).await.unwrap(), first);
    assert_eq!(&store.program_chunk(first.id, 0).await.unwrap()[..], b"G0 X1\n");
}

#[tokio::test]
async fn concurrent_puts_store_one_program() {
    let place = Place::new();
    let store = open(&place).await;
    let mut puts = tokio::task::JoinSet::new();
    for _ in 0..16 {
        let store = store.clone();
        puts.spawn(async move { store.put_program(source(100_000).into()).await.unwrap() });
    }
    let infos = puts.join_all().await;
    assert!(infos.iter().all(|info| *info == infos[0]));
}

#[tokio::test]
async fn any_chunk_is_read_alone() {
    let place = Place::new();
    let store = open(&place).await;
    let chunk = CHUNK_BYTES as usize;
    for size in [0, 1, chunk - 1, chunk, chunk + 1, 3 * chunk + 17] {
        let source = source(size);
        let info = store.put_program(source.clone().into()).await.unwrap();
        assert_eq!(info.chunk_count, size.div_ceil(chunk) as u64, "{size} bytes");
        for (index, expected) in source.chunks(chunk).enumerate().rev() {
            assert_eq!(store.program_chunk(info.id, index as u64).await.unwrap(), expected, "chunk {index} of {size}");
        }
        assert_eq!(read_back(&store, info.id).await, source);
        for beyond in [info.chunk_count, u64::MAX] {
            let missing = store.program_chunk(info.id, beyond).await;
            assert!(matches!(missing, Err(StoreError::NotFound { kind: Kind::Program, .. })));
        }
    }
}

#[tokio::test]
async fn too_large_is_refused() {
    let place = Place::new();
    let store = place.open(StoreSettings { max_program_bytes: 10, ..StoreSettings::default() }).await;
    store.put_program("0123456789".into()).await.unwrap();
    let refused = store.put_program("0123456789A".into()).await;
    assert!(matches!(refused, Err(StoreError::TooLarge { size: 11, limit: 10, .. })), "{refused:?}");
    let store = open(&place).await;
    let refused = store.put_program(vec![b' '; MAX_PUT_BYTES as usize + 1].into()).await;
    assert!(matches!(refused, Err(StoreError::TooLarge { limit: MAX_PUT_BYTES, .. })), "{refused:?}");
}

#[tokio::test]
async fn a_referenced_program_stays() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let job = store.create_job(new_job("r", program)).await.unwrap();
    let refused = store.delete_program(program).await;
    assert!(matches!(refused, Err(StoreError::InUse { users: 1, .. })), "{refused:?}");
    store.program_chunk(program, 0).await.unwrap();

    store.delete_job(job.id, None).await.unwrap();
    store.delete_program(program).await.unwrap();
    assert!(matches!(store.program_info(program).await, Err(StoreError::NotFound { .. })));
    assert!(matches!(store.delete_program(program).await, Err(StoreError::NotFound { .. })));
}

#[tokio::test]
async fn a_deleted_program_can_be_put_again() {
    let place = Place::new();
    let store = open(&place).await;
    let source = source(5 * CHUNK_BYTES as usize);
    let info = store.put_program(source.clone().into()).await.unwrap();
    store.delete_program(info.id).await.unwrap();
    store.put_program(source.clone().into()).await.unwrap();
    assert_eq!(read_back(&store, info.id).await, source);
}
